"""What an arm is: facts of each robot, models generated from them, nominal dynamics, inverse kinematics."""

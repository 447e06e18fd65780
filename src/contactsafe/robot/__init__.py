"""What an arm is: description of each robot, models generated from them, nominal dynamics, inverse kinematics."""

"""Franka Research 3, from published figures; frames, shape and tools: `contactsafe.robot.franka`.

Limits, masses, centres and inertias: franka_description, robots/fr3, joint_limits.yaml and inertials.yaml (Franka
Robotics). Rotor inertia is what remains of it under the joints' torque control, as identified in MuJoCo Menagerie's
franka_fr3, 2025-04-25. Friction of this form is not published for the FR3: the Panda's stands in.
"""

from contactsafe.robot.description import Inertia, Joint
from contactsafe.robot.franka import franka_arm
from contactsafe.robot.panda import FRICTION

_LARGE_ROTOR, _SMALL_ROTOR = 0.195, 0.074

FR3 = franka_arm(
    name="fr3",
    source="franka_description robots/fr3; rotor inertia: MuJoCo Menagerie; friction: the Panda's, Gaz et al. 2019",
    base=Inertia(2.3966, (-0.0172, 0.0004, 0.0745), (0.0090, 0.0115, 0.0085, 0.0, 0.0020, 0.0)),
    inertias=(
        Inertia(
            2.9274653454,
            (4.128e-7, -0.0181251324, -0.0386035970),
            (
                0.023927316485107913, 0.0224821613275756, 0.006350098258530016,
                1.3317903455714081e-05, -0.00011404774918616684, -0.0019950320628240115,
            ),
        ),
        Inertia(
            2.9355370338,
            (0.0031828864, -0.0743221644, 0.0088146084),
            (
                0.041938946257609425, 0.02514514885014724, 0.06170214472888839,
                0.00020257331521090626, 0.004077784227179924, -0.0042252158006570156,
            ),
        ),
        Inertia(
            2.2449013699,
            (0.0407015686, -0.0048200565, -0.0289730823),
            (
                0.02410142547240885, 0.01974053266708178, 0.019044494482244823,
                0.002404694559042109, -0.002856269270114313, -0.002104212683891874,
            ),
        ),
        Inertia(
            2.6155955791,
            (-0.0459100965, 0.0630492960, -0.0085187868),
            (
                0.03452998321913202, 0.028881621933049058, 0.04125471171146641,
                0.01322552265982813, 0.01015142998484113, -0.0009762833870704552,
            ),
        ),
        Inertia(
            2.3271207594,
            (-0.0016039605, 0.0292536262, -0.0972965990),
            (
                0.051610278463662895, 0.04787729713371481, 0.016423625579357254,
                -0.005715173387783472, -0.0035673167625872135, 0.010673985108535986,
            ),
        ),
        Inertia(
            1.8170376524,
            (0.0597131221, -0.0410294666, -0.0101692726),
            (
                0.005412333594383447, 0.014058329545509979, 0.016080817924212554,
                0.006193456360285834, 0.0014219289306117652, -0.0013140753741120031,
            ),
        ),
        Inertia(
            0.6271432862,
            (0.0045225817, 0.0086261921, -0.0161633251),
            (
                0.00021092389150104718, 0.00017718568002411474, 5.993190599659971e-05,
                -2.433299114461931e-05, 4.564480393778983e-05, 8.744070223226438e-05,
            ),
        ),
    ),
    joints=(  # q_min, q_max (rad), qd_max (rad/s), tau_max (N m), friction, rotor inertia (kg m²)
        Joint(-2.7437, 2.7437, 2.62, 87.0, FRICTION[0], _LARGE_ROTOR),
        Joint(-1.7837, 1.7837, 2.62, 87.0, FRICTION[1], _LARGE_ROTOR),
        Joint(-2.9007, 2.9007, 2.62, 87.0, FRICTION[2], _LARGE_ROTOR),
        Joint(-3.0421, -0.1518, 2.62, 87.0, FRICTION[3], _LARGE_ROTOR),
        Joint(-2.8065, 2.8065, 5.26, 12.0, FRICTION[4], _SMALL_ROTOR),
        Joint(0.5445, 4.5169, 4.18, 12.0, FRICTION[5], _SMALL_ROTOR),
        Joint(-3.0159, 3.0159, 5.26, 12.0, FRICTION[6], _SMALL_ROTOR),
    ),
)  # fmt: skip

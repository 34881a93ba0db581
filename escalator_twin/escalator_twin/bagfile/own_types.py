"""The project's message definitions, for bags that carry none and for processes without ROS.

The same as ``escalator_msgs/msg`` less its comments; a test compares the two.
"""

DEFINITIONS = {
    'escalator_msgs/msg/Experiment': """
std_msgs/Header header
string machine
string case_id
float64 set_speed
int8 direction
float64 load_per_step
float64 preload
string notes
""",
    'escalator_msgs/msg/LinkStrain': """
std_msgs/Header header
string link
float64[4] strain
""",
    'escalator_msgs/msg/TensionerDisplacement': """
std_msgs/Header header
float64 displacement
""",
    'escalator_msgs/msg/LinkForce': """
std_msgs/Header header
string link
float64 force
""",
    'escalator_msgs/msg/RollerForce': """
std_msgs/Header header
int32 axle
string side
float64 s
float64 normal_force
""",
}

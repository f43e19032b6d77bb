"""Pure kinematics in metres and radians: the arm, the wrist, and both in one chain."""

"""Legs that hold one body on another: kinematics, inertia, struts and joints."""

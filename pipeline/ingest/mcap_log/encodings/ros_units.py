"""Units of ROS's own message types, which their definitions state in words (REP 103 and the comments of each type)."""

from __future__ import annotations

# By type and member; a member that is a vector gives its unit to its parts.
UNITS: dict[str, dict[str, str]] = {
    "geometry_msgs/Accel": {"linear": "m/s^2", "angular": "rad/s^2"},
    "geometry_msgs/Pose": {"position": "m"},
    "geometry_msgs/Transform": {"translation": "m"},
    "geometry_msgs/Twist": {"linear": "m/s", "angular": "rad/s"},
    "geometry_msgs/Wrench": {"force": "N", "torque": "N*m"},
    "sensor_msgs/BatteryState": {"voltage": "V", "temperature": "degC", "current": "A"},
    "sensor_msgs/FluidPressure": {"fluid_pressure": "Pa"},
    "sensor_msgs/Imu": {"angular_velocity": "rad/s", "linear_acceleration": "m/s^2"},
    "sensor_msgs/MagneticField": {"magnetic_field": "T"},
    "sensor_msgs/NavSatFix": {"latitude": "deg", "longitude": "deg", "altitude": "m"},
    "sensor_msgs/Range": {"field_of_view": "rad", "min_range": "m", "max_range": "m", "range": "m"},
    "sensor_msgs/Temperature": {"temperature": "degC"},
}

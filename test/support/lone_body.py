"""A robot without joints, as files: one box in free flight."""

from __future__ import annotations

from pathlib import Path

import yaml

from spacerobot_ros.effects.robot_file import RobotFile, load_robot_file

BOX = """<robot name="box"><link name="base_link"><inertial>
<origin xyz="{com}"/><mass value="23"/>
<inertia ixx="0.30" iyy="0.34" izz="0.40" ixy="0" ixz="0" iyz="0"/>
</inertial></link></robot>"""


def box_file(
    folder: Path, name: str = 'box', com: str = '0 0 0', robot: dict | None = None, **sections
) -> RobotFile:
    """The box with sections of its robot file, such as `effects`, written to a folder."""
    (folder / 'box.urdf').write_text(BOX.format(com=com))
    content = {
        'robot': {'urdf': 'box.urdf', 'joints': [], **(robot or {})},
        'sensors': {'gyro_std': 1e-4, 'attitude_std': 1e-4},
        'initial': {'angular_velocity': [0.1, 0.2, 0.05]},
        'simulator': {'joint_rate': 50.0, 'imu_rate': 50.0, 'period': 0.02},
        **sections,
    }
    path = folder / f'{name}.yaml'
    path.write_text(yaml.safe_dump({'/**': {'ros__parameters': content}}))
    return load_robot_file(path)

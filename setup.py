"""What pyproject.toml can not say: files that ROS 2 finds under the prefix of an installation."""

from glob import glob

from setuptools import find_packages, setup

PACKAGE = 'spacerobot_ros'
SHARE = f'share/{PACKAGE}'
MESSAGES = f'{PACKAGE}.recording.bags.msg'

setup(
    packages=[*find_packages(include=[PACKAGE, f'{PACKAGE}.*']), MESSAGES],
    package_dir={MESSAGES: 'msg_defs/msg'},
    package_data={
        PACKAGE: ['py.typed', 'schemas/*.json', 'report/assets/*', '*/*.yaml', 'ros/*.xml'],
        MESSAGES: ['*.msg'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        # colcon build --symlink-install links these, and no other files, to where it builds
        (SHARE, ['package.xml', 'pyproject.toml']),
        (f'{SHARE}/config', sorted(glob('config/*.urdf') + glob('config/*.yaml'))),
        (f'{SHARE}/config/examples', sorted(glob('config/examples/*'))),
        (f'{SHARE}/config/views', sorted(glob('config/views/*'))),
        (f'{SHARE}/config/security', sorted(glob('config/security/*'))),
        (f'{SHARE}/launch', sorted(glob('launch/*.py'))),
        (f'lib/{PACKAGE}', sorted(glob('programs/*'))),
    ],
)

"""What pyproject.toml can not say: files that ROS 2 finds under the prefix of an installation."""

from glob import glob

from setuptools import Distribution, find_namespace_packages, setup

PACKAGE = 'spacerobot_ros'
SHARE = f'share/{PACKAGE}'


class Readable(Distribution):
    """What colcon can read: it evaluates every attribute's text (colcon-python-setup-py#33)."""

    def parse_config_files(self, *args, **kwargs):
        """Read pyproject.toml, too."""
        super().parse_config_files(*args, **kwargs)
        self.python_requires = self.metadata.python_requires = str(self.python_requires)


setup(
    distclass=Readable,
    license='Apache-2.0',  # setuptools of before 77 and after take it here alone without a word
    packages=find_namespace_packages(include=[PACKAGE, f'{PACKAGE}.*'], exclude=['*.__pycache__']),
    package_data={
        '': ['py.typed', '*.css', '*.html', '*.js', '*.json', '*.msg', '*.txt', '*.xml', '*.yaml']
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

"""Package spacerobot_ros: nodes, command line, and the files they share."""

from glob import glob

from setuptools import find_packages, setup

PACKAGE = 'spacerobot_ros'

setup(
    name=PACKAGE,
    version='0.1.0',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={
        PACKAGE: ['py.typed', 'schemas/*.json', 'report/assets/*', '*/*.yaml', 'ros/*.xml']
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/config', sorted(glob('config/*.urdf') + glob('config/*.yaml'))),
        (f'share/{PACKAGE}/config/examples', sorted(glob('config/examples/*'))),
        (f'share/{PACKAGE}/config/views', sorted(glob('config/views/*'))),
        (f'share/{PACKAGE}/config/security', sorted(glob('config/security/*'))),
        (f'share/{PACKAGE}/launch', sorted(glob('launch/*.py'))),
    ],
    install_requires=['setuptools'],
    extras_require={
        'fleet': ['bokeh', 'dask', 'distributed', 'pyarrow'],
        'test': ['pytest'],  # by which `colcon test` knows how
    },
    zip_safe=True,
    maintainer='spacerobot_ros maintainers',
    maintainer_email='maintainers@spacerobot.invalid',
    description='Onboard estimation and control of a free-floating space robot.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'simulator = spacerobot_ros.nodes.entry:simulator',
            'identifier = spacerobot_ros.nodes.entry:identifier',
            'monitor = spacerobot_ros.nodes.entry:monitor',
            'controller = spacerobot_ros.nodes.entry:controller',
            'composed = spacerobot_ros.nodes.entry:composed',
            'spacerobot = spacerobot_ros.cli.main:main',
        ],
    },
)

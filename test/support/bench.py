"""An identifier, and what plays its sensors."""

import numpy as np
from geometry_msgs.msg import QuaternionStamped
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from std_srvs.srv import Trigger

from spacerobot_ros.nodes.identifier import IdentifierNode
from spacerobot_ros.ros.convert import compose
from spacerobot_ros.ros.qos import LATCHED, SAMPLES
from support.rig import Wall

NAMES = ['joint_1', 'joint_2', 'joint_3']
MS = 1_000_000


class Bench:
    """An identifier with a probe that plays the sensors."""

    def __init__(self, rig, parameters, **more):
        self.rig, self.probe = rig, rig.plain()
        self.estimates = rig.listen(self.probe, EstimateMessage, '/estimate', LATCHED)
        topics = {'/imu/data': Imu, '/attitude': QuaternionStamped, '/joint_states': JointState}
        self.publishers = {
            topic: self.probe.create_publisher(kind, topic, SAMPLES)
            for topic, kind in topics.items()
        }
        self.node, self.wall = rig.add(IdentifierNode, parameters, **more), Wall()
        self.node.wall_ns = self.wall.ns

    def send(self, topic, message):
        self.publishers[topic].publish(message)

    def gyro(self, ms, omega=(0.1, 0.1, 0.1), frame='base_link'):
        self.send('/imu/data', compose.imu(ms * MS, frame, np.array(omega), None))

    def star(self, ms, q=(0.0, 0.0, 0.0, 1.0)):
        self.send('/attitude', compose.quaternion(ms * MS, np.array(q)))

    def joint(self, ms, q=(0.0, 0.0, 0.0), names=NAMES):
        message = compose.joint_state(ms * MS, list(names), np.array(q), np.zeros(3))
        self.send('/joint_states', message)

    def all(self, start, stop):
        for ms in range(start, stop, 10):
            self.gyro(ms)
            self.joint(ms)
            if ms % 100 == 0:
                self.star(ms)
        self.rig.drain()

    def status(self, name):
        return next(s for s in self.node.health.statuses() if s.name == name)

    def call(self, name):
        client = self.probe.create_client(Trigger, name)
        future = client.call_async(Trigger.Request())
        self.rig.until(future.done)
        return future.result()

#!/usr/bin/python3
"""The simulated camera: it moves, stops before solids, and a mapper maps what it publishes."""
import math
import os
import subprocess
import threading
import unittest

import numpy
import rospy
from frontier_surfels.msg import Coverage, FrameReport
from frontier_surfels.srv import MoveCamera
from geometry_msgs.msg import Point, PoseStamped
from roslib.packages import find_node
from sensor_msgs.msg import CameraInfo, Image
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from mapper_client import TIMEOUT, Mapper, case, run, wait_until

CAMERA = 'simulated_camera'
MOVE_TIMEOUT = 60  # [s] it begins with finding out what can be seen


def goal_of(x, y, z, yaw=0.0, frame='map'):
    goal = PoseStamped()
    goal.header.frame_id = frame
    goal.pose.position.x, goal.pose.position.y, goal.pose.position.z = x, y, z
    goal.pose.orientation.z, goal.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return goal


class Topic:
    """Keeps the messages of a topic."""

    def __init__(self, name, kind):
        self.messages, self.changed = [], threading.Condition()
        self.subscriber = rospy.Subscriber(name, kind, self.add, queue_size=1000)
        wait_until(lambda: self.subscriber.get_num_connections() > 0, MOVE_TIMEOUT, f'somebody to publish {name}')

    def add(self, message):
        with self.changed:
            self.messages.append(message)
            self.changed.notify_all()

    def find(self, condition):
        """The newest message that fulfils a condition."""
        def newest():
            return next((message for message in reversed(self.messages) if condition(message)), None)

        with self.changed:
            assert self.changed.wait_for(newest, TIMEOUT), f'nothing came on {self.subscriber.name}'
            return newest()

    def at(self, stamp):
        return self.find(lambda message: message.header.stamp == stamp)


class Simulation(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.wait_for_service(f'{CAMERA}/move', MOVE_TIMEOUT)
        cls.move = rospy.ServiceProxy(f'{CAMERA}/move', MoveCamera)
        cls.image, cls.info = Topic('depth/image', Image), Topic('depth/camera_info', CameraInfo)
        cls.coverage, cls.tf = Topic(f'{CAMERA}/coverage', Coverage), Topic('/tf', TFMessage)
        cls.tf_static = Topic('/tf_static', TFMessage)
        cls.mapper = Mapper()
        wait_until(lambda: cls.mapper.subscriber.get_num_connections() > 0, what='the mapper')
        wait_until(lambda: len(rospy.client.get_published_topics()) and cls.listeners('depth/image') >= 2, what='the mapper to listen')

    @staticmethod
    def listeners(topic):
        subscribers = rospy.get_master().getSystemState()[2][1]
        return sum(len(nodes) for name, nodes in subscribers if name == '/' + topic)

    def setUp(self):
        self.assertEqual(self.move(goal=goal_of(0.8, 3.95, 1.2)).message[-1], '.')

    def transform_at(self, stamp):
        def moves(message):
            return any(t.header.stamp == stamp and t.child_frame_id == 'base_link' for t in message.transforms)

        return self.tf.find(moves).transforms[0]

    def test_moves_take_images(self):
        response = self.move(goal=goal_of(2.0, 3.95, 1.3, 0.5))
        self.assertTrue(response.success, response.message)
        self.assertAlmostEqual(response.metres, math.hypot(1.2, 0.1), places=6)
        self.assertAlmostEqual(response.pose.position.x, 2.0)
        image, info = self.image.at(response.stamp), self.info.at(response.stamp)
        self.assertEqual((image.encoding, image.width, image.height, image.header.frame_id), ('32FC1', 160, 120, 'camera_optical'))
        depth = numpy.frombuffer(image.data, numpy.float32)
        self.assertGreater(depth.min(), 0.2)
        self.assertLess(depth.max(), 10)
        self.assertAlmostEqual(info.P[0], 80 / math.tan(math.radians(29)), places=6)
        transform = self.transform_at(response.stamp)
        self.assertEqual((transform.header.frame_id, transform.transform.translation.z), ('map', 1.3))
        self.assertAlmostEqual(transform.transform.rotation.z, math.sin(0.25))
        optical = self.tf_static.find(lambda message: message.transforms[0].child_frame_id == 'camera_optical').transforms[0]
        self.assertEqual(optical.header.frame_id, 'base_link')
        q = optical.transform.rotation
        for component, expected in zip((q.x, q.y, q.z, q.w), (-0.5, 0.5, -0.5, 0.5)):
            self.assertAlmostEqual(abs(component), abs(expected))

    def test_the_mapper_maps_them(self):
        response = self.move(goal=goal_of(2.9, 3.95, 1.3, -math.pi / 2))
        header = self.image.at(response.stamp).header
        report = self.mapper.report(header)
        self.assertEqual((report.result, report.reason), (FrameReport.INTEGRATED, ''))
        self.assertAlmostEqual(report.pose.position.x, 2.9, places=2)
        self.assertGreater(report.surfels, 1000)

    def test_stops_before_solids(self):
        response = self.move(goal=goal_of(0.8, 6.5, 1.2, 1.0))
        self.assertFalse(response.success)
        self.assertRegex(response.message, r'stopped after 0\.42 of 2\.55 m: a solid would come closer than 0\.2 m\.$')
        self.assertAlmostEqual(response.pose.position.y, 4.37, places=2)
        self.image.at(response.stamp)

    def test_passes_corners(self):
        views = self.coverage.at(self.move(goal=goal_of(0.8, 3.95, 1.2)).stamp).views
        response = self.move(via=[Point(8.4, 3.95, 1.2), Point(8.4, 2.6, 1.2)], goal=goal_of(7.4, 2.6, 1.2))
        self.assertTrue(response.success, response.message)
        self.assertAlmostEqual(response.metres, 7.6 + 1.35 + 1, places=6)
        self.assertEqual(self.coverage.at(response.stamp).views, views + 1)
        response = self.move(via=[Point(8.4, 2.6, 1.2), Point(0.8, 2.6, 1.2)], goal=goal_of(0.8, 3.95, 1.2))
        self.assertFalse(response.success)  # walls are in the way
        self.assertAlmostEqual(response.pose.position.y, 2.6, places=6)
        here = response.pose
        response = self.move(via=[Point(math.inf, 2.6, 1.2)], goal=goal_of(8.4, 2.6, 1.2))
        self.assertRegex(response.message, 'corner.*finite')
        self.assertEqual((response.stamp.to_sec(), response.pose), (0, here))
        self.assertTrue(self.move(via=[Point(8.4, 2.6, 1.2), Point(8.4, 3.95, 1.2)], goal=goal_of(0.8, 3.95, 1.2)).success)

    def test_starts_again(self):
        before = self.coverage.at(self.move(goal=goal_of(2.0, 3.95, 1.2)).stamp)
        response = rospy.ServiceProxy(f'{CAMERA}/reset', Trigger)()
        self.assertTrue(response.success, response.message)
        after = self.coverage.find(lambda message: message.header.stamp > before.header.stamp)
        self.assertEqual((after.views, after.metres, after.seconds, after.seen, after.share), (0, 0, 0, 0, 0))
        self.assertEqual(after.visible, before.visible)
        response = self.move(goal=goal_of(1.0, 3.95, 1.2))
        self.assertAlmostEqual(response.metres, 0.2)
        self.assertEqual(self.coverage.at(response.stamp).views, 1)

    def test_refuses_goals_that_make_no_sense(self):
        before = self.move(goal=goal_of(1.0, 3.95, 1.2))
        views = self.coverage.at(before.stamp).views
        for goal, sentence in ((goal_of(math.nan, 0, 0), 'finite'), (goal_of(1, 4, 1, frame='odom'), "'odom'.*'map'")):
            with case(sentence):
                response = self.move(goal=goal)
                self.assertFalse(response.success)
                self.assertRegex(response.message, sentence)
                self.assertEqual((response.metres, response.stamp.to_sec(), response.pose), (0, 0, before.pose))
        zero = goal_of(1, 4, 1)
        zero.pose.orientation.w = 0
        self.assertRegex(self.move(goal=zero).message, 'quaternion')
        self.assertEqual(self.coverage.messages[-1].views, views)

    def test_follows_goals_of_the_topic(self):
        publisher = rospy.Publisher(f'{CAMERA}/goal', PoseStamped, queue_size=1)
        wait_until(lambda: publisher.get_num_connections() > 0)
        publisher.publish(goal_of(1.7, 3.9, 1.1, frame='/map'))
        message = self.tf.find(lambda message: abs(message.transforms[0].transform.translation.x - 1.7) < 1e-9)
        self.assertEqual(message.transforms[0].child_frame_id, 'base_link')

    def test_coverage_grows_with_new_views(self):
        before = self.coverage.at(self.move(goal=goal_of(8.4, 3.95, 1.2, -math.pi / 2)).stamp)
        response = self.move(goal=goal_of(8.4, 2.6, 1.2, -math.pi / 2))
        self.assertTrue(response.success, response.message)
        after = self.coverage.at(response.stamp)
        self.assertGreater(after.share, before.share)
        self.assertEqual(after.views, before.views + 1)
        self.assertEqual(after.visible, before.visible)
        self.assertAlmostEqual(after.share, after.seen / after.visible)
        self.assertAlmostEqual(after.metres, before.metres + response.metres)
        self.assertGreater(after.seconds, before.seconds)
        self.assertTrue(self.move(goal=goal_of(8.4, 3.95, 1.2)).success)

    def test_images_are_taken_on_request(self):
        views = self.coverage.at(self.move(goal=goal_of(0.8, 3.95, 1.2)).stamp).views
        response = rospy.ServiceProxy(f'{CAMERA}/capture', Trigger)()
        self.assertTrue(response.success)
        self.coverage.find(lambda message: message.views == views + 1)

    def start(self, name, **parameters):
        arguments = [f'__name:={name}', *(f'_{key}:={value}' for key, value in parameters.items())]
        self.addCleanup(lambda: rospy.has_param(name) and rospy.delete_param(name))
        process = subprocess.Popen([find_node('frontier_surfels', CAMERA)[0], *arguments, 'depth/image:=other/image',
                                    'depth/camera_info:=other/info', '/tf:=other/tf', '/tf_static:=other/tf_static'],
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def test_all_wrong_parameters_are_told_at_once(self):
        process = self.start('refused', width=4, fov='wide', radius=-1.0, body_frame='map', z_min=3.0, z_max=2.0)
        output = process.communicate(timeout=TIMEOUT)[0]
        self.assertEqual(process.returncode, 1, output)
        for sentence in ('width is 4 pixel', 'fov is wide: it must be a number', 'radius is -1', 'three different names', 'z_max'):
            self.assertRegex(output, sentence)

    def test_a_start_in_a_wall_is_refused(self):
        output = self.start('refused', start_x=0.05).communicate(timeout=TIMEOUT)[0]
        self.assertRegex(output, r'cannot start at 0\.05, 3\.95, 1\.2 m: a solid is less than the radius of 0\.2 m away\.')

    def test_noise_and_rate(self):
        self.start('noisy', noise=True, publish_rate=10.0, coverage_spacing=0.5, width=80, height=60)
        images = Topic('other/image', Image)
        first = images.find(lambda image: True)
        self.assertEqual((first.encoding, first.step), ('16UC1', 160))
        images.find(lambda image: image.header.stamp > first.header.stamp)
        a, b = images.messages[:2]
        self.assertNotEqual(a.data, b.data)


if __name__ == '__main__':
    run('test_simulation', Simulation)

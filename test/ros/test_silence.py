#!/usr/bin/python3
"""Nothing comes to be mapped: no /clock, a mistyped topic, a topic that is published but silent. It is told why, and what to do."""
import signal
import subprocess
import unittest

import rospy
from frontier_surfels.msg import FrameReport
from roslib.packages import find_node
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from mapper_client import TIMEOUT, CameraTopics, Mapper, run, wait_until
from synthetic_camera import pose, transform


class Silence(unittest.TestCase):
    """/use_sim_time is true, but nobody publishes /clock."""

    def start(self, name, *arguments):
        program = find_node('frontier_surfels', 'mapper_node')[0]
        mapper = Mapper(name)
        process = subprocess.Popen([program, f'__name:={name}', *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        mapper.wait_until_connected()
        return process, mapper

    def reason(self, mapper, *parts):
        """Waits for a report that says all this about missing input, and returns the reason."""
        def find():
            return [report.reason for report in list(mapper.reports)
                    if report.result == FrameReport.NO_INPUT and all(part in report.reason for part in parts)]
        return wait_until(find, what=f'a report with {parts}')[0]

    def check_warned_once(self, process, *reasons):
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=TIMEOUT)[0]
        for reason in reasons:
            self.assertEqual(output.count(reason), 1, output)

    def test_mistyped_topic_and_no_clock(self):
        camera = CameraTopics()
        process, mapper = self.start('mistyped', 'depth/image:=' + camera.depth.name.replace('rect', 'rekt'))
        topic = self.reason(mapper, '/camera/depth/image_rekt, which no node publishes', 'remap depth/image', '/camera/depth/image_rect')
        clock = self.reason(mapper, '/clock', '/use_sim_time', 'rosbag play --clock')
        self.check_warned_once(process, topic, clock)

    def test_the_last_time_of_the_clock_ends_nothing(self):
        process, mapper = self.start('endless', 'depth/image:=camera/depth/image_rect')
        clock = rospy.Publisher('/clock', Clock, queue_size=1)
        self.addCleanup(clock.unregister)
        wait_until(lambda: '/endless' in [connection.endpoint_id for connection in clock.impl.connections], what='a listener of /clock')
        clock.publish(Clock(rospy.Time(4294967295, 999999999)))
        self.reason(mapper, '/camera/depth/image_rect')
        self.assertTrue(mapper.pause(False).success)
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=TIMEOUT)[0]
        self.assertEqual(process.returncode, 0, output)
        self.assertIn('Check what publishes /clock', output)

    def test_topics_that_are_silent(self):
        camera = CameraTopics()
        process, mapper = self.start('silent', 'depth/image:=camera/depth/image_rect', 'depth/camera_info:=camera/depth/camera_info',
                                     'color/image:=camera/color/imag')
        mapper.wait_until_connected(*camera.raw())
        depth = self.reason(mapper, '/camera/depth/image_rect, although a node publishes it', 'rostopic hz')
        stamp = rospy.Time(1000)
        camera.tf_static.publish(TFMessage([transform(pose(0), 'map', camera.frame, stamp)]))
        report = mapper.report(camera.send(0, stamp=stamp, send_pose=False))
        self.assertEqual((report.result, report.reason), (FrameReport.INTEGRATED, ''))  # it maps without /clock
        color = self.reason(mapper, 'No colour image has come on /camera/color/imag', 'use_color')
        self.check_warned_once(process, depth, color)


if __name__ == '__main__':
    run('test_silence', Silence)

#!/usr/bin/python3
"""With /clock: a bag that loops, images that are merely late, and images with impossible stamps."""
import time

import rospy
from frontier_surfels.msg import FrameReport
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from mapper_client import Mapper, MapperTest, run, wait_until
from synthetic_camera import pose, transform

STEPS = 3
INTERVAL = 0.8  # [s]; a bag is then longer than the longest delay of an image


class ClockTest(MapperTest):
    @classmethod
    def setUpClass(cls):
        cls.clock = rospy.Publisher('/clock', Clock, queue_size=10)
        super().setUpClass()
        cls.resetting = Mapper('resetting')
        for mapper in (cls.mapper, cls.resetting):
            mapper.wait_until_connected(cls.clock, *cls.camera.raw())
        cls.now = 1000.0

    def setUp(self):
        self.set_time(self.now + 100)
        super().setUp()
        self.assertTrue(self.resetting.reset().success)

    def set_time(self, seconds):
        """Sets ROS time, and waits until it has arrived."""
        type(self).now = seconds
        self.clock.publish(Clock(rospy.Time.from_sec(seconds)))
        wait_until(lambda: abs(rospy.Time.now().to_sec() - seconds) < 1e-6, what='/clock')
        time.sleep(0.1)

    def play(self, start, clock_first=True):
        """Plays a little bag, until both mappers have mapped it."""
        for mapper in (self.mapper, self.resetting):
            mapper.reports.clear()  # earlier reports have the same stamps
        for step in range(STEPS):
            if clock_first or step > 0:
                self.set_time(start + INTERVAL * step)
            header = self.camera.send(step, stamp=rospy.Time.from_sec(start + INTERVAL * step))
            report = self.check_integrated(header)
            self.check_integrated(header, self.resetting)
        return report

    def check_loops(self, clock_first):
        start = self.now
        first = self.play(start)
        once = self.mapper.surfels()
        self.assert_same_but_ids(once, self.resetting.surfels())
        for loop in range(2):
            kept = self.play(start, clock_first)
            again = self.resetting.surfels()
            if clock_first:
                self.assert_same_but_ids(once, again)
            else:  # tf knows later poses already: it interpolates, which rounds differently
                self.assertLess(abs(len(again) - len(once)), 0.01 * len(once))
        self.assertEqual(kept.sequence, first.sequence + 2 * STEPS)  # there was no reset
        # The images are the same ones again, in which hardly anything is new.
        self.assertLess(abs(kept.surfels - first.surfels), 0.2 * first.surfels)

    def test_bag_that_loops(self):
        self.check_loops(clock_first=True)

    def test_bag_that_loops_and_its_images_overtake_the_clock(self):
        self.check_loops(clock_first=False)

    def test_transforms_of_the_future_are_forgotten(self):
        """After a jump back, poses from before it are not used, although their stamps fit."""
        start = self.now
        for seconds in (0.0, 5.0, 10.0):
            self.set_time(start + seconds)
            self.check_integrated(self.camera.send(0, stamp=rospy.Time.from_sec(start + seconds)))
        self.set_time(start + 4)
        self.check_dropped(self.camera.send(1, stamp=rospy.Time.from_sec(start + 4), send_pose=False), FrameReport.DROPPED_NO_POSE, '.')
        self.check_integrated(self.camera.send(1, stamp=rospy.Time.from_sec(start + 4.1)))

    def test_image_that_is_merely_late(self):
        start = self.now
        report = self.play(start)
        for mapper in (self.mapper, self.resetting):
            before = mapper.surfels()
            header = self.camera.send(0, stamp=rospy.Time.from_sec(start + 1.2))
            self.check_dropped(header, FrameReport.DROPPED_OUT_OF_ORDER, 'older', mapper)
            self.assert_same_map(before, mapper.surfels())
        self.assertGreater(report.surfels, 0)

    def test_impossible_stamps_reset_nothing(self):
        """Images without a stamp or with one in the far future are dropped, and are not taken for a jump of time. Their pose is known."""
        start = self.now
        self.play(start)
        self.camera.new_frame()
        self.camera.tf_static.publish(TFMessage([transform(pose(2), 'map', self.camera.frame, rospy.Time.from_sec(start))]))
        self.set_time(start + 2)
        mapped = self.check_integrated(self.camera.send(2, stamp=rospy.Time.from_sec(start + 2), send_pose=False), self.resetting)
        before = self.resetting.surfels()
        for stamp, reason in ((rospy.Time(0), 'stamp is 0'), (rospy.Time(4000000000), 'stamp of 4000000000 s'),
                              (rospy.Time(4294967295, 990000000), 'stamp of 4294967295 s')):
            header = self.camera.send(0, stamp=stamp, send_pose=False)
            self.check_dropped(header, FrameReport.DROPPED_NO_POSE, reason + '.*driver', self.resetting)
        self.assert_same_map(before, self.resetting.surfels())
        self.set_time(start + 2.5)
        report = self.check_integrated(self.camera.send(2, stamp=rospy.Time.from_sec(start + 2.5), send_pose=False), self.resetting)
        self.assertEqual(report.sequence, mapped.sequence + 1)  # there was no reset

    def test_transforms_of_the_far_future_block_nothing(self):
        self.camera.send_pose(pose(0), rospy.Time(4000000000))
        self.play(self.now)


if __name__ == '__main__':
    run('test_clock', ClockTest)

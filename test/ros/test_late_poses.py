#!/usr/bin/python3
"""Images that wait for their poses. With a camera of 30 Hz, poses that are published 100 ms late, and a mapper that is faster than the
camera, images are mapped all the same."""
import time

from frontier_surfels.msg import FrameReport

from mapper_client import MapperTest, run
from synthetic_camera import Camera, pose, raw_image

RATE = 30  # [Hz]
DELAY = 0.1  # [s] of the poses
IMAGES = 90
STEPS = 8  # of the walk, which is repeated
FEW = 9  # images. A machine that is busy with other things for some hundredths of a second makes the mapper slower than the camera.


class LatePoses(MapperTest):
    def shoot(self, poses_per_message):
        """Sends images and their poses at their times. Poses come in groups, as from an odometry that is slower than the camera.
        Returns the headers of the images."""
        images = [raw_image(self.camera.camera.depth(step), '16UC1', None) for step in range(STEPS)]
        start, headers, sent = time.monotonic(), [], 0
        while sent < IMAGES:
            next_image = len(headers) / RATE if len(headers) < IMAGES else float('inf')
            last_of_group = min(sent + poses_per_message, IMAGES) - 1
            next_pose = last_of_group / RATE + DELAY
            time.sleep(max(0, start + min(next_image, next_pose) - time.monotonic()))
            if next_image < next_pose:
                step = len(headers) % STEPS
                headers.append(self.camera.send(step, send_pose=False, message=images[step]))
                continue
            for number in range(sent, last_of_group + 1):
                self.camera.send_pose(pose(number % STEPS), headers[number].stamp)
            sent = last_of_group + 1
        return headers

    def check_few_lost(self, poses_per_message):
        self.camera.camera = Camera(160, 120)
        self.map_walk(STEPS)  # compiles the kernels
        headers = self.shoot(poses_per_message)
        reports = [self.mapper.report(header) for header in headers]
        lost = [(report.result, report.reason) for report in reports if report.result != FrameReport.INTEGRATED]
        self.assertEqual({result for result, _ in lost} - {FrameReport.DROPPED_QUEUE}, set(), lost)
        self.assertLessEqual(len(lost), FEW, lost)

    def test_images_are_mapped(self):
        self.check_few_lost(1)

    def test_images_are_mapped_though_poses_come_in_threes(self):
        self.check_few_lost(3)

    def test_an_image_without_pose_holds_up_no_others(self):
        lost = self.camera.send(0, send_pose=False)
        self.camera.new_frame()
        self.map_walk(3)
        self.assertEqual([report.reason for report in self.mapper.reports if report.header.frame_id == lost.frame_id], [])  # it still waits

    def test_pose_that_comes_after_a_later_image_was_mapped(self):
        frame = self.camera.frame
        header = self.camera.send(0, send_pose=False)
        self.camera.new_frame()
        self.map_walk(1, first=1)
        self.camera.send_pose(pose(0), header.stamp, child=frame)
        self.check_dropped(header, FrameReport.DROPPED_OUT_OF_ORDER, 'order')

    def wait_for_arrival(self):
        """Waits until everything that was sent so far has reached the mapper. A damaged image follows, as images arrive in order."""
        frame = self.camera.frame
        self.camera.new_frame()
        damaged = raw_image(self.camera.camera.depth(0), '', None)
        self.check_dropped(self.camera.send(0, send_pose=False, message=damaged), FrameReport.DROPPED_BAD_IMAGE, 'encoding')
        self.camera.frame = frame

    def test_pause_while_an_image_waits(self):
        header = self.camera.send(0, send_pose=False)
        self.wait_for_arrival()
        self.addCleanup(self.mapper.pause, False)
        self.assertTrue(self.mapper.pause(True).success)
        self.camera.send_pose(pose(0), header.stamp)
        self.check_dropped(header, FrameReport.DROPPED_PAUSED, 'paused')
        self.mapper.pause(False)
        self.map_walk(1, first=1)

    def test_reset_while_an_image_waits(self):
        """The image was taken before the reset, so that it is not mapped afterwards."""
        self.map_walk(1)
        header = self.camera.send(1, send_pose=False)
        self.wait_for_arrival()
        self.assertTrue(self.mapper.reset().success)
        self.camera.send_pose(pose(1), header.stamp)
        self.check_dropped(header, FrameReport.DROPPED_QUEUE, 'reset')
        self.assertEqual(len(self.mapper.surfels()), 0)
        self.map_walk(1, first=2)


if __name__ == '__main__':
    run('test_late_poses', LatePoses)

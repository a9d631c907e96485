#!/usr/bin/python3
"""A camera of 30 Hz whose poses are published 100 ms late, and a mapper that is faster than the camera: no image is lost."""
import time

from frontier_surfels.msg import FrameReport

from mapper_client import MapperTest, run
from synthetic_camera import Camera, pose, raw_image

RATE = 30  # [Hz]
DELAY = 0.1  # [s] of the poses
IMAGES = 90
STEPS = 8  # of the walk, which is repeated


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

    def check_none_lost(self, poses_per_message):
        self.camera.camera = Camera(160, 120)
        self.map_walk(STEPS)  # compiles the kernels
        headers = self.shoot(poses_per_message)
        reports = [self.mapper.report(header) for header in headers]
        lost = [(report.result, report.reason) for report in reports if report.result != FrameReport.INTEGRATED]
        self.assertEqual(lost, [])

    def test_every_image_is_mapped(self):
        self.check_none_lost(1)

    def test_every_image_is_mapped_though_poses_come_in_threes(self):
        self.check_none_lost(3)


if __name__ == '__main__':
    run('test_late_poses', LatePoses)

#!/usr/bin/python3
"""Screenshots of rviz with the shipped configuration show the map."""
import io
import os
import subprocess
import time
import unittest

import numpy
from PIL import Image as Picture

from mapper_client import CameraTopics, Mapper, run, wait_until
from synthetic_camera import BACK

RENDERED = (slice(80, 880), slice(380, 1380))  # rows and columns of the window that show the map, with rviz/mapper.rviz


class Rviz(unittest.TestCase):
    def start(self, *command, **options):
        process = subprocess.Popen(command, **options)
        self.addCleanup(process.wait)
        self.addCleanup(process.terminate)
        return process

    def start_display(self):
        """Starts an X server, which chooses a free number. Returns the environment for programs on it."""
        read_end, write_end = os.pipe()
        self.start('Xvfb', '-displayfd', str(write_end), '-screen', '0', '1400x900x24', '-nolisten', 'tcp', pass_fds=[write_end],
                   stderr=subprocess.DEVNULL)
        os.close(write_end)
        with os.fdopen(read_end) as pipe:
            return {**os.environ, 'DISPLAY': ':' + pipe.readline().strip()}

    def screenshot(self):
        result = subprocess.run(['/usr/bin/import', '-silent', '-window', 'root', 'png:-'], env=self.display, stdout=subprocess.PIPE,
                                check=True, timeout=30)
        return numpy.asarray(Picture.open(io.BytesIO(result.stdout)).convert('RGB'))[RENDERED].astype(int)

    def count(self):
        """Counts the pixels in the frontier's blue, and those in the orange of the colour images."""
        red, green, blue = numpy.moveaxis(self.screenshot(), -1, 0)
        self.counted = int(((blue > 80) & (blue > 1.5 * red)).sum()), int(((red > 150) & (red > 1.5 * green) & (green > 1.5 * blue)).sum())
        return self.counted

    def wait_for(self, condition, what):
        try:
            wait_until(lambda: time.sleep(0.3) or condition(*self.count()), 120, what)
        except AssertionError as fault:
            raise AssertionError(f'{fault}; last seen: {self.counted} pixels of blue and of orange') from None

    def test_the_map_is_seen(self):
        self.display = self.start_display()
        self.start('roslaunch', 'frontier_surfels', 'mapper.launch', 'world_frame:=world', 'rviz:=true', 'publish_period:=0.2',
                   'color_image:=camera/color/image', env=self.display)
        camera, mapper = CameraTopics(world='world'), Mapper()
        mapper.wait_until_connected(*camera.raw(), camera.color)
        nothing = lambda blue, orange: blue < 500 and orange < 500
        self.wait_for(nothing, 'a view without a map')
        orange = numpy.full((camera.camera.height, camera.camera.width, 3), (230, 120, 20), dtype=numpy.uint8)
        for step in range(BACK, BACK + 8):
            self.assertEqual(mapper.report(camera.send(step, color=orange)).reason, '')
        self.wait_for(lambda blue, orange: blue > 20000 and orange > 5000, 'the map')
        mapper.reset()
        self.wait_for(nothing, 'the map to be gone')


if __name__ == '__main__':
    run('test_rviz', Rviz)

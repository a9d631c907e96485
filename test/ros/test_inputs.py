#!/usr/bin/python3
"""Images, cameras and colours of every kind, good and bad."""
import time

import numpy
import rospy
from frontier_surfels.msg import FrameReport
from sensor_msgs.msg import Image, PointCloud2, RegionOfInterest

from mapper_client import Mapper, MapperTest, case, has_color, run, to_array, wait_until
from synthetic_camera import Camera, compressed_depth, header_of, metres, pose, raw_image

STEPS = 3


class Inputs(MapperTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.compressed, cls.blind, cls.colored = Mapper('compressed'), Mapper('blind'), Mapper('colored')
        cls.compressed.wait_until_connected(cls.camera.compressed, cls.camera.info, cls.camera.tf)
        cls.blind.wait_until_connected(cls.camera.depth, cls.camera.tf)
        cls.colored.wait_until_connected(cls.camera.color, *cls.camera.raw())

    def map_of(self, make_message, mapper=None):
        """The map of a short walk. `make_message` makes the message of an image of millimetres."""
        mapper = mapper or self.mapper
        mapper.reset()
        self.camera.new_frame()
        for step in range(STEPS):
            message = make_message(self.camera.camera.depth(step))
            self.check_integrated(self.camera.send(step, message=message), mapper)
        return mapper.surfels()

    def test_every_encoding_gives_the_same_map(self):
        expected = self.map_of(lambda depth: raw_image(depth, '16UC1', None))
        for name, make_message in {
                'mono16': lambda depth: raw_image(depth, 'mono16', None),
                '32FC1': lambda depth: raw_image(metres(depth), '32FC1', None),
                '16UC1, big endian': lambda depth: raw_image(depth, '16UC1', None, big_endian=True),
                '32FC1, big endian': lambda depth: raw_image(metres(depth), '32FC1', None, big_endian=True),
                '16UC1, padded rows': lambda depth: raw_image(depth, '16UC1', None, padding=6)}.items():
            with case(name):
                self.assert_same_but_ids(expected, self.map_of(make_message))
        with case('compressedDepth'):
            self.assert_same_but_ids(expected, self.map_of(lambda depth: compressed_depth(depth, None), self.compressed))

    def check_bad_image(self, reason, message, mapper=None):
        return self.check_dropped(self.camera.send(0, message=message), FrameReport.DROPPED_BAD_IMAGE, reason, mapper)

    def test_images_that_are_not_depth_are_refused(self):
        self.map_walk(2)
        before = self.mapper.map()
        color, depth = self.camera.camera.color(), self.camera.camera.depth(0)
        self.check_bad_image("'rgb8'", raw_image(color, 'rgb8', None))
        self.check_bad_image("''", raw_image(depth, '', None))
        cut = raw_image(depth, '16UC1', None)
        cut.data = cut.data[:1000]
        self.check_bad_image('1000 bytes', cut)
        narrow = raw_image(depth, '16UC1', None)
        narrow.step = 10
        narrow.data = narrow.data[:10 * narrow.height]
        self.check_bad_image('step', narrow)
        self.check_bad_image('empty', Image(encoding='16UC1'))
        huge = Image(encoding='16UC1', width=2**31, height=2**31, step=2**31)
        self.check_bad_image('bytes', huge)
        after = self.mapper.map()
        self.assertEqual(before[0], after[0])
        self.assert_same_map(before[1], after[1])
        self.map_walk(1, first=2)

    def test_damaged_compressed_images_are_refused(self):
        self.compressed.reset()
        good = compressed_depth(self.camera.camera.depth(0), None)
        for size in (0, 5, 12, 13, 300):
            bad = compressed_depth(self.camera.camera.depth(0), None)
            bad.data = bad.data[:size]
            self.check_bad_image('compressed', bad, self.compressed)
        self.assertEqual(len(self.compressed.surfels()), 0)
        self.check_integrated(self.camera.send(0, message=good), self.compressed)

    def test_images_without_measurements_change_nothing(self):
        self.map_walk(3)
        before = self.mapper.surfels()
        shape = (self.camera.camera.height, self.camera.camera.width)
        for value in (numpy.nan, numpy.inf, -numpy.inf, 0.0, -1.0, 1e30):
            message = raw_image(numpy.full(shape, value, dtype=numpy.float32), '32FC1', None)
            report = self.mapper.report(self.camera.send(2, message=message))
            self.assertIn(report.result, (FrameReport.INTEGRATED, FrameReport.DROPPED_BAD_IMAGE), report.reason)
            self.assertEqual(report.surfels, len(before), f'after an image of {value}')
            self.assertRegex(report.reason, r'^The depth image .*: .*\.$')
        for value, reason in ((0, 'no measurement in any pixel'), (65535, '65535 in every pixel'), (20000, 'correct depth_unit')):
            report = self.mapper.report(self.camera.send(2, message=raw_image(numpy.full(shape, value, dtype=numpy.uint16), '16UC1', None)))
            self.assertEqual(report.result, FrameReport.INTEGRATED)
            self.assertRegex(report.reason, reason)
        rows, columns = numpy.indices(shape)
        noise = (600 * 1.06 ** (5 * (columns % 5) + rows % 5)).astype(numpy.uint16)  # the pixels of a block differ by 6 % or more
        report = self.mapper.report(self.camera.send(2, message=raw_image(noise, '16UC1', None)))
        self.assertEqual((report.result, report.measured_pixels), (FrameReport.INTEGRATED, 0))
        self.assertRegex(report.reason, r'^The depth image has depths from .* differ by more than agreement.* sampling: nearest\.$')
        report = self.mapper.report(self.camera.send(2, message=raw_image(1000 * metres(self.camera.camera.depth(2)), '32FC1', None)))
        self.assertRegex(report.reason, 'look like millimetres')
        self.assert_same_but_ids(before, self.mapper.surfels())

    def test_no_camera_info(self):
        header = self.camera.send(0)
        self.check_dropped(header, FrameReport.DROPPED_NO_CAMERA, 'camera_info.*/nobody/camera_info', self.blind)
        self.check_integrated(header)

    def test_camera_changes_its_size(self):
        self.check_integrated(self.camera.send(0))
        self.camera.camera = Camera(160, 120)
        self.check_integrated(self.camera.send(1))
        self.camera.camera = Camera(320, 240)
        self.check_integrated(self.camera.send(2))

    def test_camera_info_of_another_size(self):
        self.check_integrated(self.camera.send(0))  # from here on the mapper knows this camera, and no more that of another case
        image = raw_image(Camera(160, 120).depth(0), '16UC1', None)
        self.check_dropped(self.camera.send(1, message=image), FrameReport.DROPPED_NO_CAMERA, '160x120.*320x240')
        self.check_integrated(self.camera.send(2))

    def test_camera_alternates_its_size(self):
        """As if two cameras published on one topic. It is told once; each image is mapped with its own camera."""
        reasons = []
        for step in range(8):
            self.camera.camera = Camera(320, 240) if step % 2 else Camera(160, 120)
            report = self.mapper.report(self.camera.send(step))
            self.assertEqual(report.result, FrameReport.INTEGRATED, report.reason)
            reasons.append(report.reason)
        self.assertRegex(reasons[3], '160x120 and of 320x240 pixels alternate.*topics of one camera')
        self.assertEqual(set(reasons[:3] + reasons[4:]), {''})

    def test_regions_outside_the_sensor(self):
        for region in (RegionOfInterest(width=400, height=240), RegionOfInterest(x_offset=200, width=160, height=120)):
            self.camera.camera = Camera()
            self.camera.camera.roi = region
            size = (region.height, region.width)
            image = raw_image(numpy.full(size, 1500, dtype=numpy.uint16), '16UC1', None)
            self.check_dropped(self.camera.send(0, message=image), FrameReport.DROPPED_NO_CAMERA, 'not within the sensor of 320x240')

    def test_distortion_without_p(self):
        self.camera.camera.distortion = [0.1, -0.2, 0.0, 0.0, 0.0]
        reasons = [self.mapper.report(self.camera.send(step)).reason for step in range(4)]  # the first image may overtake its camera_info
        self.assertRegex(''.join(reasons), '^The camera_info has distortion, but no P: [^:]*taken as rectified[^:]*$')

    def test_camera_info_a_little_later_than_its_image(self):
        self.check_integrated(self.camera.send(0))
        self.camera.camera = small = Camera(160, 120)
        header = header_of(self.camera.frame)
        self.camera.send_pose(pose(1), header.stamp)
        self.camera.depth.publish(raw_image(small.depth(1), '16UC1', header))
        time.sleep(0.05)
        self.camera.info.publish(small.info(header))
        self.check_integrated(header)

    def test_camera_info_that_is_none(self):
        for name, value in (('f', 0.0), ('f', -100.0), ('f', float('nan')), ('cx', float('inf')), ('f', 1e-9)):
            with case(f'{name} = {value}'):
                self.camera.camera = Camera()
                image = raw_image(self.camera.camera.depth(0), '16UC1', None)
                setattr(self.camera.camera, name, value)
                self.camera.info.publish(self.camera.camera.info(header_of(self.camera.frame)))
                time.sleep(0.5)  # so that the image does not overtake it, on a busy machine either
                report = self.mapper.report(self.camera.send(0, message=image))
                self.assertIn(report.result, (FrameReport.DROPPED_NO_CAMERA, FrameReport.DROPPED_BAD_IMAGE), report.reason)
        self.assertEqual(len(self.mapper.surfels()), 0)

    def colored_share(self):
        surfels = self.colored.surfels()
        return numpy.mean(has_color(surfels)[surfels['label'] == 1])

    def map_in_color(self, send):
        """Maps what `send` sends of each step, until most surfels have a colour: on a busy machine a colour image may come too late."""
        for _ in range(10):
            self.colored.reset()
            for step in range(3):
                self.check_integrated(send(step), self.colored)
            if self.colored_share() > 0.8:
                return
        self.fail('Most surfels have no colour.')

    def test_color(self):
        color = self.camera.camera.color()
        self.map_in_color(lambda step: self.camera.send(step, color=color))
        surfels = self.colored.surfels()
        self.assertEqual(set(surfels['rgb'][surfels['label'] == 0] & 0xFFFFFF), {0x0000FF})  # the frontier is blue
        colorless = self.mapper.surfels()  # of a mapper without use_color
        self.assertFalse(has_color(colorless).any())
        self.assertEqual(set(colorless['rgb'][colorless['label'] == 1] & 0xFFFFFF), {0x808080})

    def test_confidence(self):
        """It is 1 for frontier surfels, or for occupied ones if ~cloud_confidence says so."""
        self.colored.reset()
        header = self.camera.send(0)
        for mapper in (self.mapper, self.colored):
            self.check_integrated(header, mapper)
        surfels = self.mapper.surfels()
        self.assertTrue((surfels['confidence'] == (surfels['label'] == 0)).all())
        clouds = [self.colored.surfels()]
        subscriber = rospy.Subscriber('colored/surfels', PointCloud2, lambda cloud: clouds.append(to_array(cloud)))
        self.addCleanup(subscriber.unregister)
        wait_until(lambda: len(clouds) > 1 and len(clouds[-1]) == len(clouds[0]), what='the cloud of the whole map')
        for surfels in clouds:
            self.assertTrue((surfels['confidence'] == (surfels['label'] == 1)).all())

    def test_color_a_little_later_than_depth(self):
        color = self.camera.camera.color()
        self.check_integrated(self.camera.send(0, color=color), self.colored)

        def send(step):
            header = self.camera.send(step + 1)
            time.sleep(0.015)
            self.camera.color.publish(raw_image(color, 'rgb8', header))
            return header

        self.map_in_color(send)

    def test_color_of_another_size_costs_no_frame(self):
        self.colored.reset()
        for step in range(2):
            self.check_integrated(self.camera.send(step, color=Camera(160, 120).color()), self.colored)
        self.assertEqual(self.colored_share(), 0)


if __name__ == '__main__':
    run('test_inputs', Inputs)

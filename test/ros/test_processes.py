#!/usr/bin/python3
"""The node as a process: how it starts, what it refuses, how it ends."""
import os
import re
import shutil
import signal
import subprocess
import tempfile
import threading
import time
import unittest

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from frontier_surfels.msg import FrameReport, SurfelUpdate
from roslib.packages import find_node
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from mapper_client import TIMEOUT, CameraTopics, Mapper, has_color, run, wait_until
from synthetic_camera import Camera, compressed_depth, pose, raw_image, transform

REMAPPINGS = ['depth/image:=camera/depth/image_rect', 'depth/camera_info:=camera/depth/camera_info',
              'color/image:=camera/color/image']


class Processes(unittest.TestCase):
    def start(self, name, environment=None, **parameters):
        """Starts a mapper as a process of this test."""
        program = find_node('frontier_surfels', 'mapper_node')[0]
        arguments = [f'__name:={name}', *REMAPPINGS, *(f'_{key}:={value}' for key, value in parameters.items())]
        self.addCleanup(lambda: rospy.has_param(name) and rospy.delete_param(name))
        process = subprocess.Popen([program, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                   env={**os.environ, **(environment or {})})
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def check_refused(self, *sentences, **parameters):
        process = self.start('refused', **parameters)
        output = process.communicate(timeout=TIMEOUT)[0]
        self.assertEqual(process.returncode, 1, output)
        for sentence in sentences:
            self.assertRegex(output, sentence)

    def test_all_wrong_parameters_are_told_at_once(self):
        self.check_refused('z_max.*number', 'decimation', 'on_time_jump.*keep or reset', 'tf_timeout', 'cloud_confidence.*frontier or occupied',
                           'sampling.*mean or nearest', 'noise is -1 m', 'agreement is 0',
                           z_max='far', decimation=0, on_time_jump='never', tf_timeout=-1.0, cloud_confidence='high',
                           sampling='median', noise=-1.0, agreement=0.0)

    def test_no_such_device(self):
        self.check_refused('no-such-platform', platform='no-such-platform')

    def test_no_such_transport(self):
        self.check_refused("~image_transport is 'carrier_pigeon'.*install.*raw", image_transport='carrier_pigeon')
        self.check_refused("~color_transport is 'carrier_pigeon'.*install.*raw", color_transport='carrier_pigeon')
        self.check_refused('color_transport is compressedDepth.*raw or compressed', color_transport='compressedDepth')

    def test_colour_has_a_transport_of_its_own(self):
        camera, mapper = CameraTopics(), Mapper('packed')
        self.start('packed', image_transport='compressedDepth')
        mapper.wait_until_connected(camera.compressed, camera.color, camera.info, camera.tf)
        for step in range(10):  # on a busy machine a colour image may come too late for its depth image
            message = compressed_depth(camera.camera.depth(step), None)
            report = mapper.report(camera.send(step, message=message, color=camera.camera.color()))
            self.assertEqual(report.result, FrameReport.INTEGRATED, report.reason)
            if has_color(mapper.surfels()).any():
                return
        self.fail('No surfel has a colour.')

    def test_transforms_that_cannot_be_used(self):
        """They end nothing, and one line is printed about each kind of fault, not two by tf for each transform."""
        camera, mapper = CameraTopics(), Mapper('unmoved')
        process = self.start('unmoved')
        mapper.wait_until_connected(*camera.raw())
        last = rospy.Time(4294967295, 999999999)
        for step in range(3):
            stamp = rospy.Time.now()
            for parent, child, time_of in (('map', camera.frame, last), ('map', '', stamp), ('', camera.frame, stamp), ('map', 'map', stamp)):
                for _ in range(5):
                    camera.tf.publish(TFMessage([transform(pose(step), parent, child, time_of)]))
            report = mapper.report(camera.send(step))
            self.assertEqual(report.result, FrameReport.INTEGRATED, report.reason)
        report = mapper.report(camera.send(3, stamp=last, send_pose=False))
        self.assertEqual(report.result, FrameReport.DROPPED_NO_POSE, report.reason)
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=TIMEOUT)[0]
        self.assertEqual(process.returncode, 0, output)
        for fault in ('stamp of 4294967295', 'its child_frame_id is empty', 'its frame_id is empty', 'both its frames are the same'):
            self.assertEqual(len(re.findall(f'A transform.*is not used.*{fault}.*test_processes', output)), 1, output)
        self.assertLess(len(output.splitlines()), 10, output)

    def test_one_reason_of_dropped_images_hides_no_other(self):
        camera, mapper = CameraTopics(), Mapper('dropping')
        process = self.start('dropping')
        mapper.wait_until_connected(*camera.raw())
        encodings = ('rgb8', 'no_such_encoding')
        for encoding in encodings:
            report = mapper.report(camera.send(0, message=raw_image(camera.camera.depth(0), encoding, None)))
            self.assertEqual(report.result, FrameReport.DROPPED_BAD_IMAGE, report.reason)
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=TIMEOUT)[0]
        self.assertEqual(process.returncode, 0, output)
        for encoding in encodings:
            self.assertRegex(output, rf"'{encoding}'.*\(1 depth image dropped\)")

    def test_unknown_parameters_are_warned_of(self):
        process = self.start('warned', z_maximum=4.0, decimatoin=2)
        Mapper('warned').wait_until_connected()
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=TIMEOUT)[0]
        self.assertEqual(process.returncode, 0, output)
        self.assertRegex(output, '~z_maximum')
        self.assertRegex(output, '~decimatoin.*decimation')

    def test_parameters_in_force_are_on_the_parameter_server(self):
        self.start('told', z_max=2.5)
        Mapper('told').wait_until_connected()
        parameters = rospy.get_param('told')
        self.assertEqual((parameters['z_max'], parameters['z_min'], parameters['world_frame'], parameters['marker_limit']),
                         (2.5, 0.5, 'map', 100000))
        self.assertEqual((parameters['remove_buried'], parameters['map_folder']), (True, ''))

    def test_the_map_folder_may_begin_with_a_tilde(self):
        home = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, home)
        process = self.start('homely', {'HOME': home}, map_folder='~/map')
        Mapper('homely').wait_until_connected()
        self.assertEqual(rospy.get_param('homely/map_folder'), os.path.join(home, 'map'))
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=TIMEOUT)[0]
        self.assertIn(os.path.join(home, 'map') + '.', output)
        self.assertIn('map.sqlite', os.listdir(os.path.join(home, 'map')))

    def test_a_deleted_map_folder_is_told_at_once_and_at_the_end(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        camera, mapper = CameraTopics(), Mapper('bereft')
        process = self.start('bereft', map_folder=os.path.join(folder, 'map'))
        mapper.wait_until_connected(*camera.raw())
        shutil.rmtree(os.path.join(folder, 'map'))
        self.assertEqual(mapper.report(camera.send(0)).result, FrameReport.INTEGRATED)
        told = []
        subscriber = rospy.Subscriber('/diagnostics', DiagnosticArray, lambda message: told.extend(
            status.message for status in message.status if 'bereft' in status.name and status.level == 2))
        self.addCleanup(subscriber.unregister)
        sentence = 'has been deleted, moved or replaced'
        wait_until(lambda: any(sentence in message for message in told), what='the fault in /diagnostics')
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=TIMEOUT)[0]
        self.assertEqual(process.returncode, 1, output)
        self.assertRegex(output, f'ERROR.*: The map folder .* {sentence}')
        self.assertRegex(output, f'FATAL. The end of the map is lost. The map folder .* {sentence}')

    def test_a_loaded_map_is_shown_before_the_first_frame(self):
        """/diagnostics counts it, and its clouds, markers and updates are stamped with now."""
        camera, source = CameraTopics(), Mapper('source')
        self.start('source')
        source.wait_until_connected(*camera.raw())
        surfels = source.report(camera.send(0)).surfels
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        path = os.path.join(folder, 'map.ply')
        self.assertTrue(source.save(path).success)
        stamps = {}
        self.start('shown')
        shown = Mapper('shown')
        shown.wait_until_connected()
        start = rospy.Time.now()
        self.assertTrue(shown.load(path).success)

        def see(topic, kind, stamp_of):
            subscriber = rospy.Subscriber(topic, kind, lambda message: stamps.setdefault(topic, stamp_of(message)))
            self.addCleanup(subscriber.unregister)

        for topic in ('shown/surfels', 'shown/occupied', 'shown/frontier'):
            see(topic, PointCloud2, lambda message: message.header.stamp)
        see('shown/update', SurfelUpdate, lambda message: message.header.stamp)
        see('shown/markers', MarkerArray, lambda message: message.markers[-1].header.stamp)
        wait_until(lambda: len(stamps) == 5, what='all topics')
        for topic, stamp in stamps.items():
            self.assertTrue(start <= stamp <= rospy.Time.now(), (topic, stamp.to_sec(), start.to_sec()))
        self.wait_for_surfels('shown', surfels)

    def wait_for_surfels(self, name, surfels):
        """Waits until /diagnostics of this mapper counts as many."""
        counted = []

        def read(array):
            counted.extend(entry.value for status in array.status if status.name.startswith(name) for entry in status.values
                           if entry.key == 'surfels')

        subscriber = rospy.Subscriber('/diagnostics', DiagnosticArray, read)
        self.addCleanup(subscriber.unregister)
        wait_until(lambda: str(surfels) in counted, what='the surfels in /diagnostics')

    def test_a_reopened_map_is_counted_before_the_first_frame(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        camera, mapper = CameraTopics(), Mapper('earlier')
        process = self.start('earlier', map_folder=folder)
        mapper.wait_until_connected(*camera.raw())
        surfels = mapper.report(camera.send(0)).surfels
        self.check_ends(process)
        self.start('later', map_folder=folder)
        Mapper('later').wait_until_connected()
        self.wait_for_surfels('later', surfels)

    def test_a_spacing_that_a_map_does_not_have_is_warned_of(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        camera, mapper = CameraTopics(), Mapper('coarse')
        process = self.start('coarse', map_folder=folder, recent_views=0)
        mapper.wait_until_connected(*camera.raw())
        self.assertEqual(mapper.report(camera.send(0)).result, FrameReport.INTEGRATED)
        self.check_ends(process)
        self.wait_for_line(self.start('fine', map_folder=folder, recent_views=0, seen_spacing=0.002), 'WARN.*seen_spacing is 0.002 m, but')

    def wait_for_line(self, process, sentence):
        """Waits until the process has printed such a line."""
        watchdog = threading.Timer(TIMEOUT, process.kill)
        watchdog.start()
        self.addCleanup(watchdog.cancel)
        lines = []
        for line in process.stdout:
            lines.append(line)
            if re.search(sentence, line):
                return
        self.fail(f'No line with "{sentence}" in: {lines}')

    def check_ends(self, process):
        """The process ends on SIGINT, as roslaunch sends it."""
        start = time.monotonic()
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=20)[0]
        self.assertLess(time.monotonic() - start, 2)
        self.assertEqual(process.returncode, 0, output)

    def test_ends_in_the_middle_of_a_frame(self):
        camera, mapper = CameraTopics(), Mapper('busy')
        camera.camera = Camera(640, 480)
        process = self.start('busy', decimation=2)
        mapper.wait_until_connected(*camera.raw())
        for step in range(4):
            report = mapper.report(camera.send(step))
            self.assertEqual(report.result, FrameReport.INTEGRATED, report.reason)
        camera.send(4)
        camera.send(5)
        time.sleep(report.total_ms / 1000)  # about half of the time that the two take
        self.check_ends(process)

    def test_ends_while_a_frame_waits_for_its_pose(self):
        camera, mapper = CameraTopics(), Mapper('waiting')
        process = self.start('waiting', tf_timeout=10.0)
        mapper.wait_until_connected(camera.depth, camera.info)
        camera.send(0, send_pose=False)
        time.sleep(0.3)
        self.check_ends(process)

    def test_help_starts_nothing(self):
        program = find_node('frontier_surfels', 'mapper_node')[0]
        for option in ('--help', '-h'):
            result = subprocess.run([program, '__name:=helpful', option], capture_output=True, text=True, timeout=TIMEOUT,
                                    env={**os.environ, 'ROS_MASTER_URI': 'http://localhost:1'})  # it would wait for this master for ever
            self.assertEqual((result.returncode, result.stderr), (0, ''))
            self.assertRegex(result.stdout, 'usage: .*mapper_node')
            for word in ('depth/image', '~update', '~get_surfels', 'z_max', 'tf_timeout'):
                self.assertIn(word, result.stdout)

    def test_unknown_arguments_are_refused(self):
        program = find_node('frontier_surfels', 'mapper_node')[0]
        for argument, remedy in (('depth/image=foo', 'write depth/image:=foo'), ('--hlep', 'mapper_node --help'), ('foo', 'mapper_node --help')):
            result = subprocess.run([program, '__name:=unknown', 'a:=b', '_z_max:=2', argument], capture_output=True, text=True, timeout=TIMEOUT)
            self.assertEqual((result.returncode, result.stdout), (2, ''))
            self.assertRegex(result.stderr, rf"^There is no argument '{argument}': [^\n]*{remedy}[^\n]*\.\n$")

    def test_ends_without_a_frame(self):
        process = self.start('idle')
        Mapper('idle').wait_until_connected()
        self.check_ends(process)

    def test_ends_while_a_subscriber_is_stuck(self):
        camera, mapper = CameraTopics(), Mapper('watched')
        process = self.start('watched', publish_period=0.05)
        mapper.wait_until_connected(*camera.raw())
        release = threading.Event()
        self.addCleanup(release.set)
        stuck = []
        subscriber = rospy.Subscriber('watched/surfels', PointCloud2, lambda message: stuck.append(1) or release.wait(60), queue_size=1)
        self.addCleanup(subscriber.unregister)
        for step in range(10):
            mapper.report(camera.send(step))
            time.sleep(0.06)
        wait_until(lambda: stuck, what='a cloud')
        self.check_ends(process)


if __name__ == '__main__':
    run('test_processes', Processes)

#!/usr/bin/python3
"""Reset, pause, boxes, saving and loading. When a file cannot be read or written, the map and older files stay as they were."""
import os
import re
import resource
import shutil
import signal
import subprocess
import tempfile
import xmlrpc.client

import numpy
import rosgraph
from frontier_surfels.msg import FrameReport
from roslib.packages import find_node

from mapper_client import Mapper, MapperTest, case, run
from synthetic_camera import header_of, pose

SMALL_FILE = 64 * 1024  # [byte]


class Services(MapperTest):
    def setUp(self):
        super().setUp()
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.path = os.path.join(self.folder, 'map.ply')

    def check_succeeded(self, response):
        self.assertTrue(response.success, response.message)
        self.assertRegex(response.message, r'^[^\n]+\.$')

    def check_refused(self, response, *sentences):
        self.assertFalse(response.success, response.message)
        for sentence in sentences:
            self.assertRegex(response.message, sentence)

    def test_reset(self):
        report = self.map_walk(2)
        self.check_succeeded(self.mapper.reset())
        sequence, surfels = self.mapper.map()
        self.assertEqual((sequence, len(surfels)), (report.sequence + 1, 0))
        self.assertEqual(self.map_walk(1).sequence, report.sequence + 2)

    def test_pause(self):
        self.map_walk(2)
        before = self.mapper.map()
        self.check_succeeded(self.mapper.pause(True))
        self.addCleanup(self.mapper.pause, False)
        report = self.check_dropped(self.camera.send(2), FrameReport.DROPPED_PAUSED, 'pause')
        self.assertEqual((report.sequence, report.surfels), (before[0], len(before[1])))
        self.assert_same_map(before[1], self.mapper.surfels())
        self.check_succeeded(self.mapper.pause(False))
        self.assertEqual(self.map_walk(1, first=2).sequence, before[0] + 1)

    def test_surfels_of_a_box(self):
        self.map_walk(3)
        surfels = self.mapper.surfels()
        low, high = (0.0, -1.0, 0.2), (1.5, 0.5, 1.1)
        inside = numpy.all([(surfels[axis] >= low[k]) & (surfels[axis] <= high[k]) for k, axis in enumerate('xyz')], axis=0)
        self.assertGreater(inside.sum(), 100)
        self.assert_same_bytes(surfels[inside], self.mapper.map((low, high))[1])
        self.assertEqual(len(self.mapper.map(((50, 50, 50), (51, 51, 51)))[1]), 0)
        self.assertEqual(len(self.mapper.map(((1, 1, 1), (0, 0, 0)))[1]), 0)

    def assert_same_bytes(self, a, b):
        self.assertEqual(a.tobytes(), b.tobytes())

    def test_save_and_load(self):
        report = self.map_walk(3)
        saved = self.mapper.surfels()
        self.check_succeeded(self.mapper.save(self.path))
        self.assertEqual(os.listdir(self.folder), ['map.ply'])
        self.mapper.reset()
        self.check_succeeded(self.mapper.load(self.path))
        sequence, loaded = self.mapper.map()
        self.assert_same_but_ids(saved, loaded)
        self.assertEqual(sequence, report.sequence + 2)
        self.map_walk(1, first=3)  # mapping continues

    def test_save_replaces_an_older_file(self):
        self.map_walk(1)
        self.check_succeeded(self.mapper.save(self.path))
        size = os.path.getsize(self.path)
        self.map_walk(2, first=1)
        self.check_succeeded(self.mapper.save(self.path))
        self.assertGreater(os.path.getsize(self.path), size)
        self.assertEqual(os.listdir(self.folder), ['map.ply'])

    def test_the_ending_of_the_path_decides_the_format(self):
        self.map_walk(2)
        saved = self.mapper.surfels()
        for name, start in (('map.ply', b'ply\n'), ('map.pcd', b'# .PCD v0.7')):
            with case(name):
                path = os.path.join(self.folder, name)
                self.check_succeeded(self.mapper.save(path))
                with open(path, 'rb') as file:
                    self.assertTrue(file.read().startswith(start))
                self.mapper.reset()
                self.check_succeeded(self.mapper.load(path))
                self.assert_same_but_ids(saved, self.mapper.surfels())
        for name in ('map', 'map.las'):
            with case(name):
                path = os.path.join(self.folder, name)
                self.check_refused(self.mapper.save(path), name + "'", r'must end in \.ply or \.pcd')
                self.check_refused(self.mapper.load(path), name + "'", r'must end in \.ply or \.pcd')
        self.assertEqual(sorted(os.listdir(self.folder)), ['map.pcd', 'map.ply'])

    def test_answers_name_the_absolute_path(self):
        """The node's current folder is not that of its caller, and no shell expands `~` for it."""
        self.map_walk(1)
        home = tempfile.mkdtemp(dir=os.path.expanduser('~'))
        self.addCleanup(shutil.rmtree, home)
        current = os.readlink(f'/proc/{self.mapper_process()}/cwd')
        for given, path in ((os.path.join('~', os.path.basename(home), 'map.ply'), os.path.join(home, 'map.ply')),
                            (os.path.relpath(self.path, current), self.path)):
            with case(given):
                for answer in (self.mapper.save(given), self.mapper.load(given)):
                    self.check_succeeded(answer)
                    self.assertIn(f' {path}.', answer.message)
                self.assertTrue(os.path.exists(path))

    def mapper_process(self):
        """The number of the mapper's process."""
        server = rosgraph.Master('/test_services').lookupNode('/mapper')
        return xmlrpc.client.ServerProxy(server).getPid('/test_services')[2]

    def test_names_that_are_too_long(self):
        path = os.path.join(self.folder, 300 * 'n' + '.ply')
        of_an_empty_map = self.mapper.save(path)
        self.map_walk(1)
        for answer in (of_an_empty_map, self.mapper.save(path), self.mapper.load(path)):
            self.check_refused(answer, '/n{300}.ply.*a shorter one')

    def test_save_where_nothing_can_be_written(self):
        self.map_walk(1)
        os.mkdir(self.path)
        for path in ('', self.path, os.path.join(self.folder, 'missing', 'map.ply'), '/proc/map.ply'):
            with case(path):
                self.check_refused(self.mapper.save(path), '.')
        self.assertEqual(os.listdir(self.folder), ['map.ply'])

    def test_files_that_are_no_map_are_refused(self):
        self.map_walk(2)
        before = self.mapper.map()
        self.check_succeeded(self.mapper.save(self.path))
        with open(self.path, 'rb') as file:
            good = file.read()
        header_end = good.index(b'end_header\n') + len(b'end_header\n')
        flipped = bytearray(good)
        flipped[header_end + 1000] ^= 0x10
        foreign = (b'ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n')
        for name, content in {'damaged': bytes(flipped), 'truncated': good[:-100], 'header alone': good[:header_end], 'longer': good + b'x',
                              'half a header': good[:40], 'foreign': foreign, 'no PLY': b'a letter to a friend', 'empty': b'',
                              'no number': good.replace(b'element vertex ', b'element vertex -', 1)}.items():
            with case(name):
                path = os.path.join(self.folder, 'bad.ply')
                with open(path, 'wb') as file:
                    file.write(content)
                self.check_refused(self.mapper.load(path), 'bad.ply')
        for path in (os.path.join(self.folder, 'missing.ply'), self.folder, ''):
            with case(path):
                self.check_refused(self.mapper.load(path), '.')
        after = self.mapper.map()
        self.assertEqual(before[0], after[0])
        self.assert_same_map(before[1], after[1])

    def start(self, name, *arguments):
        """Starts another mapper."""
        command = [find_node('frontier_surfels', 'mapper_node')[0], f'__name:={name}', 'depth/image:=camera/depth/image_rect',
                   'depth/camera_info:=camera/depth/camera_info', *arguments]
        process = subprocess.Popen(command, restore_signals=False)  # else the process would inherit that Python ignores SIGXFSZ
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        mapper = Mapper(name)
        mapper.wait_until_connected(*self.camera.raw())
        return process, mapper

    def saved(self, mapper):
        """Number of surfels in the file that the mapper saves."""
        path = os.path.join(self.folder, 'saved.ply')
        self.check_succeeded(mapper.save(path))
        with open(path, 'rb') as file:
            return int(re.search(rb'element vertex (\d+)', file.read()).group(1))

    def test_save_with_a_map_folder_writes_the_whole_map(self):
        arguments = ['_map_folder:=' + os.path.join(self.folder, 'kept'), '_eviction_radius:=10']
        process, mapper = self.start('keeping', *arguments)
        self.check_integrated(self.camera.send(0), mapper)
        count = len(mapper.surfels())
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(20), 0)

        mapper = self.start('continuing', *arguments)[1]
        self.assertEqual(len(mapper.surfels()), 0)  # none is in memory before the first frame
        self.assertEqual(self.saved(mapper), count)
        header = header_of(self.camera.frame)
        T_far = pose(1)
        T_far[:3, 3] += (200, 0, 0)
        self.camera.send_pose(T_far, header.stamp)
        self.camera.send(1, stamp=header.stamp, send_pose=False)
        self.check_integrated(header, mapper)
        near = len(mapper.surfels())
        self.assertGreater(near, 1000)
        self.assertEqual(self.saved(mapper), count + near)

    def test_an_empty_map_replaces_no_file(self):
        self.map_walk(1)
        self.check_succeeded(self.mapper.save(self.path))
        size = os.path.getsize(self.path)
        self.mapper.reset()
        self.check_refused(self.mapper.save(self.path), 'empty.*map.ply.*delete')
        self.assertEqual(os.path.getsize(self.path), size)
        os.remove(self.path)
        self.check_succeeded(self.mapper.save(self.path))

    def test_full_disk_keeps_the_older_file(self):
        process, full = self.start('full')
        self.check_succeeded(full.save(self.path))  # of an empty map
        with open(self.path, 'rb') as file:
            old = file.read()
        self.check_integrated(self.camera.send(0), full)
        before = full.surfels()
        self.assertGreater(32 * len(before), SMALL_FILE)
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (SMALL_FILE, SMALL_FILE))
        self.check_refused(full.save(self.path), 'map.ply', 'space|large')
        with open(self.path, 'rb') as file:
            self.assertEqual(file.read(), old)
        self.assertEqual(os.listdir(self.folder), ['map.ply'])
        self.assert_same_map(before, full.surfels())


if __name__ == '__main__':
    run('test_services', Services)

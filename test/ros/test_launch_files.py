#!/usr/bin/python3
"""The launch files: roslaunch checks them, all arguments are documented, and those that play a bag are run."""
import glob
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

import roslaunch.rlutil
import rospkg
import yaml
from frontier_surfels.msg import FrameReport
from roslib.packages import find_node

from mapper_client import Mapper, case, run

FOLDER = os.path.join(rospkg.RosPack().get_path('frontier_surfels'), 'launch')
FILES = sorted(glob.glob(os.path.join(FOLDER, '*.launch')))
FRAMES = 10


def program(name):
    return find_node('frontier_surfels', name)[0]


class LaunchFiles(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.bag = os.path.join(cls.folder, 'room.bag')
        room = os.path.join(cls.folder, 'room')
        for command in ([program('make_synthetic'), room, '--frames', str(FRAMES), '--size', '320x240'],
                        [program('sequence_to_bag'), room, cls.bag]):
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, timeout=60)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def check(self, path, *arguments):
        """roslaunch's check reads the arguments from sys.argv."""
        saved, sys.argv = sys.argv, ['roslaunch-check', *arguments]
        try:
            self.assertIsNone(roslaunch.rlutil.check_roslaunch(path))
        finally:
            sys.argv = saved

    def test_roslaunch_check(self):
        self.assertEqual([os.path.basename(path) for path in FILES],
                         ['explore.launch', 'mapper.launch', 'openni.launch', 'realsense.launch', 'replay.launch', 'tum.launch'])
        for path in FILES:
            arguments = ['bag:=' + self.bag] if os.path.basename(path) in ('replay.launch', 'tum.launch') else []
            for more in (['rviz:=true'], ['rviz:=false', 'manager:=camera/manager']):
                with case(f'{os.path.basename(path)} {more}'):
                    self.check(path, *arguments, *more)

    def test_every_argument_is_documented(self):
        for path in FILES:
            for argument in xml.etree.ElementTree.parse(path).getroot().iter('arg'):
                if 'value' not in argument.attrib:
                    self.assertGreater(len(argument.get('doc', '')), 10, f"{path}: {argument.get('name')}")

    def parameters(self, name, *arguments):
        result = subprocess.run(['roslaunch', '--dump-params', 'frontier_surfels', name, *arguments], capture_output=True, text=True,
                                timeout=30, check=True)
        return yaml.safe_load(result.stdout)

    def test_defaults_are_left_to_the_node(self):
        self.assertEqual(sorted(self.parameters('mapper.launch')), ['/mapper/' + name for name in (
            'color_transport', 'image_transport', 'use_color', 'world_frame')])
        paper = self.parameters('mapper.launch', 'config:=' + os.path.join(FOLDER, '..', 'config', 'paper.yaml'), 'world_frame:=odom')
        self.assertEqual((paper['/mapper/recent_views'], paper['/mapper/world_frame']), (0, 'odom'))
        sensor = self.parameters('realsense.launch', 'config:=' + os.path.join(FOLDER, '..', 'config', 'realsense_d400.yaml'))
        self.assertEqual((sensor['/mapper/z_min'], sensor['/mapper/noise_growth']), (0.3, 0.0038))
        self.assertTrue(self.parameters('realsense.launch')['/mapper/use_color'])
        self.assertFalse(self.parameters('openni.launch', 'color:=false')['/mapper/use_color'])

    def launch(self, name, *arguments, bag=None):
        return subprocess.run(['roslaunch', 'frontier_surfels', name, 'bag:=' + (bag or self.bag), 'rviz:=false', *arguments],
                              capture_output=True, text=True, timeout=90)

    def in_home(self):
        """A folder in the home folder, and the same with `~`, which no shell expands in the arguments of launch files."""
        home = tempfile.mkdtemp(dir=os.path.expanduser('~'), prefix="it's ")
        self.addCleanup(shutil.rmtree, home)
        return home, os.path.join('~', os.path.basename(home))

    def test_paths_may_begin_with_a_tilde_and_have_quotes(self):
        home, tilde = self.in_home()
        shutil.copy(self.bag, os.path.join(home, 'room.bag'))
        with open(os.path.join(home, 'my.yaml'), 'w', encoding='utf-8') as file:
            file.write('recent_views: 3\nmessage_limit: 1000\n')  # the map of replay.launch then comes in parts
        self.assertEqual(self.parameters('mapper.launch', f'config:={tilde}/my.yaml')['/mapper/recent_views'], 3)
        result = self.launch('replay.launch', f'report:={tilde}/report', f'config:={tilde}/my.yaml', 'options:=--octomap-resolution 0 --no-exact',
                             bag=f'{tilde}/room.bag')
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertTrue(os.path.exists(os.path.join(home, 'report', 'report.html')))
        mapper = Mapper('mapper')
        self.addCleanup(mapper.subscriber.unregister)
        result = self.launch('tum.launch', bag=f'{tilde}/room.bag')
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertEqual(len(mapper.reports), FRAMES)

    def test_tum_bag(self):
        mapper = Mapper('mapper')
        self.addCleanup(mapper.subscriber.unregister)
        result = self.launch('tum.launch')
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        results = [(report.result, report.reason) for report in mapper.reports]
        self.assertEqual(len(results), FRAMES)
        self.assertEqual({code for code, _ in results} - {FrameReport.INTEGRATED, FrameReport.DROPPED_QUEUE}, set(), results)
        self.assertGreater(mapper.reports[-1].surfels, 1000)

    def test_replay(self):
        report = os.path.join(self.folder, 'report')
        truth = os.path.join(self.folder, 'room', 'truth')
        result = self.launch('replay.launch', 'report:=' + report, f'options:=--octomap-resolution 0 --no-exact --truth {truth}')
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        with open(os.path.join(report, 'summary.json'), encoding='utf-8') as file:
            summary = json.load(file)
        self.assertEqual(summary['input']['frames'], FRAMES)
        self.assertEqual(summary['reasons'], {})
        self.assertGreater(summary['surfels']['total'], 1000)
        self.assertGreater(summary['truth']['right'], 0.95)
        self.assertTrue(os.path.exists(os.path.join(report, 'report.html')))

    def test_live_replay_leaves_map_folders_alone(self):
        kept = os.path.join(self.folder, 'kept')
        mapper = subprocess.Popen([program('mapper_node'), '__name:=keeping', '_map_folder:=' + kept])
        self.addCleanup(mapper.wait)
        self.addCleanup(mapper.kill)
        report = os.path.join(self.folder, 'no report')
        result = subprocess.run([program('replay_score'), self.bag, '--live', '--mapper', 'keeping', '--report', report], capture_output=True,
                                text=True, timeout=60)
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertRegex(result.stderr, 'keeping.*' + kept + '.*without map_folder')


if __name__ == '__main__':
    run('test_launch_files', LaunchFiles)

#!/usr/bin/python3
"""Tests the command bench: that everything runs and is written. Times are not tested.

usage: test_bench.py BENCH MAKE_SYNTHETIC BENCH_TABLE
"""
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy
import PIL.Image

PROGRAM, MAKE_SYNTHETIC, BENCH_TABLE = None, None, None
DONE, FAILED, WRONG_USAGE = 0, 1, 2
SECTIONS = ['frames', 'stages', 'octomap', 'map_size', 'long', 'start', 'memory']


def run(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=500)


class Bench(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.room = os.path.join(cls.folder.name, 'room')
        subprocess.run([MAKE_SYNTHETIC, cls.room, '--frames', '3', '--size', '64x48'], check=True, stdout=subprocess.DEVNULL)

    def measure(self, *arguments):
        path = os.path.join(self.folder.name, 'bench.json')
        result = run('--quick', '--json', path, *arguments)
        self.assertEqual(result.returncode, DONE, result.stderr)
        with open(path, encoding='utf-8') as file:
            bench = json.load(file)
        self.assertTrue(bench['complete'])
        for section, rows in bench['sections'].items():
            self.assertTrue(rows, section)
            for row in rows:
                self.assertNotIn('error', row, section)
        return bench, result.stdout, path

    def test_all_sections(self):
        bench, output, path = self.measure(self.room)
        self.assertEqual(list(bench['sections']), SECTIONS)
        self.assertIn(bench['device'], output)
        sections = bench['sections']
        self.assertEqual([row['threads'] for row in sections['frames']], [1, 0])
        for row in sections['frames']:
            self.assertEqual((row['input'], row['width'], row['height'], row['frames']), ('room', 64, 48, 3))
            for time in (row['time_ms'], row['cpu_ms']):
                self.assertTrue(0 < time['median'] <= time['p95'] <= time['max'], time)
            self.assertIn('candidates', row['time_ms']['stages'])
        for row in sections['stages']:
            self.assertEqual('sign_field' in row['stages'] and row['stages']['sign_field'] > 0, row['recent_views'] == 0, row)
        self.assertGreater(sections['octomap'][0]['ratio_cpu'], 0)
        small, large = sections['map_size']
        self.assertEqual(small['ratio_time'], 1)
        self.assertGreaterEqual(large['loaded'], 1e6 * large['millions'])
        self.assertLess(large['loaded'], 1e6 * large['millions'] + sections['frames'][0]['surfels'])
        self.assertGreater(sections['start'][0]['cold_ms'], 0)
        memory = sections['memory'][0]
        self.assertLess(memory['rss_before_mb'], memory['rss_peak_mb'])

        table = subprocess.run([BENCH_TABLE, path], capture_output=True, text=True, timeout=60)
        self.assertEqual(table.returncode, 0, table.stderr)
        self.assertIn(bench['device'], table.stdout)
        self.assertRegex(table.stdout, r'\| 64x48, z_max 3 m, all threads: median / p95 \| \d+ / \d+ ms \|')
        self.assertEqual({line.count('|') for line in table.stdout.splitlines()[2:]}, {3})

    def test_some_sections_of_the_synthetic_room(self):
        bench, _, _ = self.measure('--only', 'octomap', '--frames', 2, '--octomap-frames', 1)
        self.assertEqual(list(bench['sections']), ['octomap'])
        self.assertEqual(bench['sections']['octomap'][0]['frames'], 1)

    def test_faults_of_the_input_are_told_as_by_replay_score(self):
        path, folder = os.path.join(self.folder.name, 'faults.json'), os.path.join(self.folder.name, 'faults')
        for fault, code, sentence in [(lambda depth: 0 * depth, FAILED, '3 of 3 depth images have no measurement in any pixel'),
                                      (lambda depth: numpy.where(depth % 50 == 0, depth, 60000), DONE, 'Only [0-9.]+ % of the measured depths are from')]:
            shutil.rmtree(folder, ignore_errors=True)
            shutil.copytree(self.room, folder)
            for name in os.listdir(os.path.join(folder, 'depth')):
                image = os.path.join(folder, 'depth', name)
                depth = numpy.array(PIL.Image.open(image)).astype(int)
                PIL.Image.fromarray(fault(depth).astype(numpy.uint16)).save(image)
            for section in ('frames', 'stages', 'octomap', 'map_size', 'memory'):
                if section == 'stages' and code == DONE:
                    continue  # has no figures of the whole recording
                with self.subTest(sentence=sentence, section=section):
                    result = run('--quick', '--only', section, '--json', path, '--', folder)
                    self.assertEqual(result.returncode, code, result.stderr)
                    if code == FAILED:
                        self.assertRegex(result.stderr, rf"^bench: The map of '{folder}' is empty\. {sentence}[^\n]*\n$")
                    else:
                        self.assertRegex(result.stdout, f'WARNING +faults: {sentence}')

    def test_wrong_usage(self):
        for text in ['--no-such-option', '--only no_such', '--frames -1', '--octomap-frames many', '--row-seconds 0']:
            with self.subTest(text=text):
                result = run(*text.split())
                self.assertEqual(result.returncode, WRONG_USAGE)
                self.assertRegex(result.stderr, r'^bench: [^\n]*\nUsage: bench --help lists the arguments\.\n$')
                self.assertEqual(result.stdout, '')

    def test_failures_are_reported_in_one_sentence(self):
        for sentence, arguments in [('no-such-recording', ['no-such-recording']),
                                    ('no-such.yaml', ['--config', 'no-such.yaml']),
                                    ('no-such-folder', [self.room, '--json', '/proc/no-such-folder/bench.json'])]:
            with self.subTest(arguments=arguments):
                result = run(*arguments)
                self.assertEqual(result.returncode, FAILED, result.stderr)
                self.assertRegex(result.stderr, rf'^bench: [^\n]*{re.escape(sentence)}[^\n]*\n$')
                self.assertEqual(result.stdout, '')


if __name__ == '__main__':
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    PROGRAM, MAKE_SYNTHETIC, BENCH_TABLE = map(os.path.abspath, sys.argv[1:])
    unittest.main(argv=sys.argv[:1], verbosity=2)

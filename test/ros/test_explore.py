#!/usr/bin/python3
"""The exploration, shortened: launch/explore.launch runs by all strategies, and what is seen is told on a page."""
import csv
import json
import os
import shutil
import subprocess
import tempfile
import unittest

from roslib.packages import find_node

from mapper_client import case, run

VIEWS = 16  # of which eight are taken at the start
STRATEGIES = ('frontiers', 'octomap', 'nearest', 'random')


class Explore(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.result = subprocess.run(
            ['roslaunch', 'frontier_surfels', 'explore.launch', 'strategies:=' + ' '.join(STRATEGIES), f'most_views:={VIEWS}',
             'report:=' + os.path.join(cls.folder, 'report')], capture_output=True, text=True, timeout=400)
        cls.output = cls.result.stdout + cls.result.stderr

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def path(self, name):
        return os.path.join(self.folder, 'report', name)

    def views(self, strategy):
        with open(self.path('exploration.csv'), encoding='utf-8') as file:
            return [{key: value if key == 'strategy' else float(value) for key, value in row.items()}
                    for row in csv.DictReader(file) if row['strategy'] == strategy]

    def test_ends_by_itself(self):
        self.assertEqual(self.result.returncode, 0, self.output)
        self.assertNotRegex(self.output, r'ERROR|FATAL|Traceback')

    def test_every_strategy_takes_its_views(self):
        for strategy in STRATEGIES:
            with case(strategy):
                views = self.views(strategy)
                first = int(views[0]['views'])  # an image is not mapped if the mapper does not know its pose yet
                self.assertLessEqual(first, 3, self.output)
                self.assertEqual([row['views'] for row in views], list(range(first, VIEWS + 1)), self.output)
                for key in ('metres', 'seconds', 'share'):
                    values = [row[key] for row in views]
                    self.assertEqual(values, sorted(values))
                self.assertGreater(views[0]['share'], 0.005)
                self.assertGreater(views[7]['share'], 1.3 * views[0]['share'])

    def test_the_planner_sees_more(self):
        """One of the views around the start shows what is far away. What the planner chooses shows more than what is random."""
        share = {strategy: self.views(strategy)[-1]['share'] for strategy in STRATEGIES}
        at_start = self.views('frontiers')[7]['share']
        self.assertGreater(share['frontiers'], at_start + 0.03, share)
        self.assertGreater(share['frontiers'] - at_start, 1.2 * (share['random'] - at_start), share)
        self.assertGreater(share['octomap'], at_start + 0.02, share)

    def test_the_robot_stays_within_the_flat(self):
        for strategy in STRATEGIES:
            for row in self.views(strategy):
                with case(f"{strategy}, view {row['views']}"):
                    self.assertTrue(0.2 < row['x'] < 9.8 and 0.2 < row['y'] < 7.8 and 0.39 < row['z'] < 2.11, row)

    def test_an_unknown_strategy_is_refused(self):
        result = subprocess.run([find_node('frontier_surfels', 'explore')[0], '__name:=refused', '_strategies:=nearest frontier'], capture_output=True, text=True,
                                timeout=30)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stdout + result.stderr, "no strategy 'frontier'.*frontiers, octomap, nearest and random")

    def test_page(self):
        with open(self.path('explore.json'), encoding='utf-8') as file:
            figures = json.load(file)
        for strategy in STRATEGIES:
            self.assertIn(strategy, json.dumps(figures))
        self.assertGreater(os.path.getsize(self.path('explore.html')), 50000)


if __name__ == '__main__':
    run('test_explore', Explore)

"""Pictures of an exploration of the synthetic flat: its map from obliquely above, without the ceiling, and its floor plan."""
import numpy

import surfel_pictures

FLAT = (10, 8, 2.5)  # [m] from the origin
CUT = 2.2  # [m] what is higher is left out
PANEL = (660, 520)  # [pixel] width and height
VIEW = numpy.array([-0.13, 0.70, -1.35])
GROWTH = 1.5  # of the discs: at this size, there would be gaps between them
OUTLINE = (0.75, 0.75, 0.75)  # of the flat's floor
LINE = 0.035  # [m] half width of the way
HIDDEN = 0.75  # how much of the way's colour there is where something hides it
CAMERA = 0.12  # [m] radius of the disc where the camera is

PLAN_HEIGHTS = (0.6, 2.0)  # [m] that the floor plan shows
PLAN_CELL = 0.02  # [m]


def flat_camera():
    """Sees the whole flat, as large as it fits."""
    corners = numpy.array([(x, y, z) for x in (0, FLAT[0]) for y in (0, FLAT[1]) for z in (0, CUT)], numpy.float32)
    corners = numpy.repeat(corners, 1000, axis=0)  # because framing() leaves out single points
    return surfel_pictures.framing(corners, VIEW, numpy.array([0, 0, 1]), focal=3, size=PANEL)


def line(positions, radius):
    """Orange discs without gaps along a line through positions [m], rows of x y z."""
    points = [positions[:1]]
    for a, b in zip(positions[:-1], positions[1:]):
        pieces = max(int(numpy.ceil(numpy.linalg.norm(b - a) / 0.2)), 1)  # splats_of_path() puts 12 discs on each
        points.append(a + (b - a) * numpy.arange(1, pieces + 1)[:, None] / pieces)
    discs = surfel_pictures.splats_of_path(numpy.concatenate(points))
    return discs._replace(radius=numpy.full_like(discs.radius, radius))


def outline():
    """The edge of the flat's floor, which shows where the map has not come to yet."""
    x, y = FLAT[:2]
    discs = line(numpy.array([(0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0), (0, 0, 0)], float), LINE / 2)
    return discs._replace(color=numpy.tile(numpy.float32(OUTLINE), (len(discs.color), 1)))


def map_picture(surfels, positions, camera):
    """A picture[height][width][3] of the map under its ceiling. surfels: as read_ply() gives them; positions: of the camera so far [m]"""
    discs = surfel_pictures.splats_of(surfels[(surfels['z'] < CUT) & (surfels['nz'] > -0.7)])  # what faces down, the camera would not see
    discs = discs._replace(radius=GROWTH * discs.radius)
    way = surfel_pictures.joined(line(positions, LINE), line(positions[-1:], CAMERA))
    picture = surfel_pictures.render(surfel_pictures.joined(discs, outline(), way), camera, PANEL).clip(0, 1)
    covered = 1 - surfel_pictures.render(way._replace(color=numpy.zeros_like(way.color)), camera, PANEL)
    return picture + HIDDEN * covered * (surfel_pictures.PATH - picture)


def floor_plan(surfels):
    """plan[y][x] with cells of 2 cm from the flat's origin: how much surface has been measured there, from 0 to 1."""
    measured = surfels[(surfels['label'] == 1) & (surfels['z'] > PLAN_HEIGHTS[0]) & (surfels['z'] < PLAN_HEIGHTS[1])]
    size = [round(FLAT[axis] / PLAN_CELL) for axis in (1, 0)]
    counts, _, _ = numpy.histogram2d(measured['y'], measured['x'], bins=size, range=[(0, FLAT[1]), (0, FLAT[0])])
    return (counts / (numpy.percentile(counts[counts > 0], 80) if counts.any() else 1)).clip(0, 1)

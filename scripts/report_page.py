"""What the pages of reports have in common: numbers as text, tables, embedded pictures, and how a page is written."""
import base64
import io
import os

import jinja2
import matplotlib.image

HERE = os.path.dirname(os.path.realpath(__file__))
# Seen from scripts/ in the source tree, and from lib/frontier_surfels or bin in an installation
TEMPLATE_FOLDERS = [os.path.join(HERE, folder) for folder in ('../share', '../../share/frontier_surfels', '../share/frontier_surfels')]
NONE = '–'


def percent(share):
    """A share as a percentage with a sensible number of digits."""
    if share is None:
        return NONE
    value = 100 * share
    digits = 1 if value >= 10 else 2 if value >= 0.1 or value == 0 else 3
    return f'{value:.{digits}f} %'


def number(value, digits=3):
    """A number with `digits` significant digits, and thin spaces between thousands."""
    if value is None:
        return NONE
    if isinstance(value, int) or abs(value) >= 10 ** (digits - 1):
        return f'{value:,.0f}'.replace(',', '\u202f')
    return f'{value:#.{digits}g}'.rstrip('.')


def table(head, rows):
    """A table for the page, without the columns that have no value at all."""
    kept = [n for n in range(len(head)) if n == 0 or any(row[n] != NONE for row in rows)]
    return {'head': [head[n] for n in kept], 'rows': [[row[n] for n in kept] for row in rows]}


def embedded(mime, data):
    return f'data:{mime};base64,' + base64.b64encode(data).decode('ascii')


def png(picture):
    file = io.BytesIO()
    matplotlib.image.imsave(file, picture.clip(0, 1), format='png')
    return embedded('image/png', file.getvalue())


def render_page(template, **values):
    """The page that a template in share/ makes of the values."""
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(TEMPLATE_FOLDERS), undefined=jinja2.StrictUndefined, autoescape=True,
                                     trim_blocks=True, lstrip_blocks=True)
    return environment.get_template(template).render(**values)


def write_whole(path, text):
    """Writes a file beside an earlier one and replaces that only when the new one is complete."""
    unfinished = path + '.unfinished'
    try:
        with open(unfinished, 'w', encoding='utf-8') as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(unfinished, path)
    finally:
        if os.path.exists(unfinished):
            os.remove(unfinished)

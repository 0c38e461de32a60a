"""A drawing of any rig from the ports of its datasheet: what drives it on the left, mechanics on the right, sensors
below.

A box is a component; in it stand its ports. Knows kinds of ports, no rig.
"""
import html

from report_units import words

# Process columns from left to right: heading, kinds of ports in it.
COLUMNS = [
    ("Command and supply", ("command", "source")),
    ("Valves and lines", ("restriction", "line")),
    ("Fluid and heat", ("flow", "compliance", "heat")),
    ("Mechanics", ("force", "transmission")),
]
KINDS = {
    "command": "command path",
    "source": "supply",
    "restriction": "restriction",
    "line": "line",
    "flow": "flow path",
    "compliance": "volume",
    "heat": "heat path",
    "force": "force",
    "transmission": "transmission",
    "sensor": "sensor",
}
WIDTH, MARGIN, BETWEEN, INSET, SPACE = 1020, 6, 34, 12, 10  # px
HEADING, LINE, PAD = 26, 16, 9


def wrap(text, width, letter=7.4):
    """Lines of at most about `width` px."""
    lines, most = [""], max(8, int(width / letter))
    for word in text.split():
        joined = (lines[-1] + " " + word).strip()
        if len(joined) > most and lines[-1]:
            lines.append(word)
        else:
            lines[-1] = joined
    return lines


def components(ports, kinds):
    """[(component, [port names])] of those kinds, in the datasheet's order; a port without component stands alone."""
    found = {}
    for kind in kinds:
        for name, component in ports.items():
            if name.partition(".")[0] == kind:
                found.setdefault((kind, component or words(name.partition(".")[2])), []).append(name)
    return [(component, names) for (_, component), names in found.items()]


class Box:
    def __init__(self, component, names, width):
        self.names, self.width = names, width
        self.title = wrap(component[:1].upper() + component[1:], width - 2 * PAD)
        self.under = [line for name in names for line in wrap(name, width - 2 * PAD, 6.4)]
        self.height = 2 * PAD + LINE * len(self.title) + 14 * len(self.under) - 2

    def svg(self, x, y, mark):
        kind = self.names[0].partition(".")[0]
        mark = mark or ("plain", "")
        parts = [
            '<g class="box {} {}"><rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{}" rx="{}"/>'.format(
                "sensor" if kind == "sensor" else "process",
                mark[0],
                x,
                y,
                self.width,
                self.height,
                16 if kind == "sensor" else 4,
            )
        ]
        line = y + PAD + 11
        for text in self.title:
            parts.append('<text class="name" x="{:.1f}" y="{:.1f}">{}</text>'.format(x + PAD, line, html.escape(text)))
            line += LINE
        for text in self.under:
            parts.append(
                '<text class="port" x="{:.1f}" y="{:.1f}">{}</text>'.format(x + PAD, line - 1, html.escape(text))
            )
            line += 14
        if mark[1]:
            wide = 7.0 * len(mark[1]) + 14
            parts.append(
                '<rect class="tag" x="{0:.1f}" y="{1:.1f}" width="{2:.1f}" height="18" rx="9"/><text class="tag"'
                ' x="{3:.1f}" y="{4:.1f}" text-anchor="middle">{5}</text>'.format(
                    x + self.width - wide + 6, y - 10, wide, x + self.width - wide / 2 + 6, y + 3, html.escape(mark[1])
                )
            )
        parts.append("<title>{}: {}</title></g>".format(KINDS.get(kind, kind), html.escape(", ".join(self.names))))
        return "".join(parts)


STYLE = """<style>
.rig text { font-family: inherit; fill: #1b2127; } .rig .name { font-size: 12.5px; font-weight: 600; }
.rig .port { font-size: 11px; fill: #5a646e; } .rig .heading { font-size: 12px; font-weight: 600; fill: #5a646e; }
.rig .frame { fill: #f6f7f9; stroke: #dfe3e8; } .rig .box rect { fill: #fff; stroke: #aeb6bf; }
.rig .flow { stroke: #8a949e; stroke-width: 2; fill: none; } .rig .head { fill: #8a949e; }
.rig .process.found > rect { fill: #fbe9e7; stroke: #c0362c; stroke-width: 2.5; }
.rig .sensor.found > rect { fill: #fdf0e3; stroke: #b4570f; stroke-width: 2.5; }
.rig .process.rival > rect { stroke: #c0362c; stroke-width: 2; stroke-dasharray: 5 4; }
.rig .sensor.rival > rect { stroke: #b4570f; stroke-width: 2; stroke-dasharray: 5 4; }
.rig .process > rect.tag { fill: #c0362c; stroke: none; } .rig .sensor > rect.tag { fill: #b4570f; stroke: none; }
.rig text.tag { fill: #fff; font-size: 11px; font-weight: 700; }
</style>"""


def arrow(x1, y1, x2, y2):
    dx, dy = (1, 0) if y1 == y2 else (0, 1)
    return (
        '<path class="flow" d="M{:.1f} {:.1f}L{:.1f} {:.1f}"/><path class="head" d="M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f}'
        ' {:.1f}z"/>'.format(
            x1,
            y1,
            x2 - 6 * dx,
            y2 - 6 * dy,
            x2,
            y2,
            x2 - 9 * dx - 5 * dy,
            y2 - 9 * dy - 5 * dx,
            x2 - 9 * dx + 5 * dy,
            y2 - 9 * dy + 5 * dx,
        )
    )


def draw(ports, marks):
    """`ports`: {name: component}; `marks`: {port: ("found" | "rival", text)}. An SVG string; None where there is no
    port."""
    columns = [(heading, components(ports, kinds)) for heading, kinds in COLUMNS]
    columns = [column for column in columns if column[1]]
    sensors = components(ports, ("sensor",))
    if not columns and not sensors:
        return None

    def mark_of(box):
        marked = [marks[name] for name in box.names if name in marks]
        return min(marked, key=lambda mark: mark[0] != "found") if marked else None

    parts, bottom = [], MARGIN
    if columns:
        wide = (WIDTH - 2 * MARGIN - BETWEEN * (len(columns) - 1)) / len(columns)
        stacks = [[Box(component, names, wide - 2 * INSET) for component, names in found] for _, found in columns]
        heights = [sum(box.height for box in stack) + SPACE * (len(stack) - 1) for stack in stacks]
        tall = max(heights) + HEADING + 2 * INSET
        for i, ((heading, _), stack) in enumerate(zip(columns, stacks)):
            x = MARGIN + i * (wide + BETWEEN)
            parts.append(
                '<rect class="frame" x="{:.1f}" y="{}" width="{:.1f}" height="{:.1f}" rx="8"/>'.format(
                    x, MARGIN, wide, tall
                )
            )
            parts.append('<text class="heading" x="{:.1f}" y="{}">{}</text>'.format(x + INSET, MARGIN + 19, heading))
            y = MARGIN + HEADING + INSET + (max(heights) - heights[i]) / 2
            for box in stack:
                parts.append(box.svg(x + INSET, y, mark_of(box)))
                y += box.height + SPACE
            if i + 1 < len(columns):
                parts.append(arrow(x + wide, MARGIN + tall / 2, x + wide + BETWEEN, MARGIN + tall / 2))
        bottom = MARGIN + tall
    if sensors:
        top = bottom + (BETWEEN if columns else 0)
        if columns:
            parts.append(arrow(WIDTH / 2, bottom, WIDTH / 2, top))
        per_row = min(4, len(sensors))
        wide = (WIDTH - 2 * MARGIN - 2 * INSET - SPACE * (per_row - 1)) / per_row
        y, inside = top + HEADING + INSET, []
        for first in range(0, len(sensors), per_row):
            row = [Box(component, names, wide) for component, names in sensors[first : first + per_row]]
            for i, box in enumerate(row):
                inside.append(box.svg(MARGIN + INSET + i * (wide + SPACE), y, mark_of(box)))
            y += max(box.height for box in row) + SPACE
        bottom = y - SPACE + INSET
        parts.append(
            '<rect class="frame" x="{}" y="{:.1f}" width="{}" height="{:.1f}" rx="8"/>'.format(
                MARGIN, top, WIDTH - 2 * MARGIN, bottom - top
            )
        )
        parts.append(
            '<text class="heading" x="{}" y="{:.1f}">Sensors: what the recording shows</text>'.format(
                MARGIN + INSET, top + 19
            )
        )
        parts += inside
    return '<svg class="rig" viewBox="0 0 {} {:.0f}" role="img" xmlns="http://www.w3.org/2000/svg">{}{}</svg>'.format(
        WIDTH, bottom + MARGIN, STYLE, "".join(parts)
    )

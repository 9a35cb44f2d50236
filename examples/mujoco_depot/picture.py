"""Picture of the depot with the paths of the robots, as SVG, or as PNG with matplotlib."""

from __future__ import annotations

from pathlib import Path

from floor import AISLE_HALF_WIDTH, BAY, PLACES, WET

Paths = dict[str, list[tuple[float, float]]]
COLOURS = {"alba": "#1f6fb4", "bruno": "#d1661b"}
SCALE = 30.0
LEFT, RIGHT, BOTTOM, TOP = 0.0, 22.0, 0.0, 17.5


def draw(file: Path, days: list[tuple[str, Paths]]) -> None:
    """Draws the paths of days side by side.

    Raises:
        ValueError: if the file's name ends with neither ``.svg`` nor ``.png``.
        ImportError: for PNG, if matplotlib is not installed.
    """
    if file.suffix == ".svg":
        file.write_text(_svg(days))
    elif file.suffix == ".png":
        _png(file, days)
    else:
        raise ValueError(f"expected a file that ends with .svg or .png, found {file}")


def _svg(days: list[tuple[str, Paths]]) -> str:
    width, height = (RIGHT - LEFT) * SCALE, (TOP - BOTTOM) * SCALE + 30
    body = "".join(
        f'<g transform="translate({number * width:.0f} 0)">{_panel(title, paths)}</g>'
        for number, (title, paths) in enumerate(days)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width * len(days):.0f} {height:.0f}" '
        f'font-family="sans-serif" font-size="16"><rect width="100%" height="100%" fill="#fff"/>{body}</svg>\n'
    )


def _panel(title: str, paths: Paths) -> str:
    x = PLACES["rack"][0]
    parts = [f'<text x="20" y="24" font-weight="bold">{title}</text>']
    parts.append(_box(x - AISLE_HALF_WIDTH, WET[0], 2 * AISLE_HALF_WIDTH, WET[1] - WET[0], "#cfe8f5"))
    parts += [
        _box(x + side * (AISLE_HALF_WIDTH + 0.5) - 0.4, WET[0], 0.8, WET[1] - WET[0], "#8a8a8a") for side in (-1, 1)
    ]
    parts.append(_box(BAY[0] - 1.5, BAY[1] + 0.4, 3.0, 1.0, "#555"))
    for robot, path in paths.items():
        points = " ".join("{:.1f},{:.1f}".format(*_at(*point)) for point in path[::3])
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="{COLOURS[robot]}" stroke-width="2" opacity="0.6"/>'
        )
    for place, point in PLACES.items():
        at_x, at_y = _at(*point)
        name = "" if place == "corner" else place
        parts.append(f'<circle cx="{at_x:.1f}" cy="{at_y:.1f}" r="5"/>')
        parts.append(f'<text x="{at_x + 34:.1f}" y="{at_y + 22:.1f}">{name}</text>')
    parts.append(_label(x - 4.2, 8, "cold store") + _label(BAY[0] + 2, BAY[1] + 0.6, "truck"))
    return "".join(parts)


def _at(x: float, y: float) -> tuple[float, float]:
    return (x - LEFT) * SCALE, (TOP - y) * SCALE + 30


def _box(x: float, y: float, width: float, height: float, colour: str) -> str:
    left, top = _at(x, y + height)
    return (
        f'<rect x="{left:.1f}" y="{top:.1f}" width="{width * SCALE:.1f}" height="{height * SCALE:.1f}" '
        f'fill="{colour}"/>'
    )


def _label(x: float, y: float, words: str) -> str:
    at_x, at_y = _at(x, y)
    return f'<text x="{at_x:.1f}" y="{at_y:.1f}">{words}</text>'


def _png(file: Path, days: list[tuple[str, Paths]]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6 * len(days), 5))
    for number, (title, paths) in enumerate(days):
        axes = figure.add_subplot(1, len(days), number + 1)
        x = PLACES["rack"][0]
        axes.fill_between([x - AISLE_HALF_WIDTH, x + AISLE_HALF_WIDTH], WET[0], WET[1], color="#cfe8f5")
        for robot, path in paths.items():
            axes.plot(*zip(*path), color=COLOURS[robot], alpha=0.6, label=robot)
        for place, point in PLACES.items():
            if place != "corner":
                axes.annotate(place, point)
        axes.set(title=title, aspect="equal", xlim=(LEFT, RIGHT), ylim=(BOTTOM, TOP), xlabel="m", ylabel="m")
        axes.legend()
    figure.savefig(file, dpi=120)

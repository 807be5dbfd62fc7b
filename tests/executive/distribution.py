"""A distribution of plug-ins, as an installer leaves it."""


def write_distribution(folder, name, group, *lines, summary="Plug-ins."):
    """Writes the metadata of a distribution that registers entry points of a group."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nSummary: {summary}\n")
    (info / "entry_points.txt").write_text("\n".join((f"[{group}]", *lines, "")))

"""What the house tests look at: the files of the repository, as git sees them, or all of them where there is no git."""

import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]


def repository_files():
    """Files that are or would be committed, relative to the root."""
    listed = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                            capture_output=True, check=False)
    if listed.returncode == 0:
        names = [pathlib.Path(name) for name in listed.stdout.decode().split("\0") if name]
    else:
        names = [path.relative_to(ROOT) for path in ROOT.rglob("*")
                 if not {".git", "build", "devel", "sanitize", "__pycache__"} & set(path.relative_to(ROOT).parts)]
    return sorted(name for name in set(names) if (ROOT / name).is_file())


def sources_below(folder):
    return [name for name in repository_files() if name.parts[:len(folder.split("/"))] == tuple(folder.split("/"))
            and name.suffix in (".h", ".cpp")]

"""What each command imports: the heavy libraries only where they are used."""

import subprocess
import sys

import pytest

HEAVY = {"pydrake", "spacy", "onnxruntime", "cv2", "numba", "scipy"}

# Command, and which of the heavy libraries it imports.
IMPORTS = [
    (["--help"], set()),
    (["parse", "--open", "fetch me a drink"], {"spacy"}),
    (["parse", "Hey Alice, fetch me a drink"], {"spacy"}),
]


@pytest.mark.parametrize(("arguments", "expected"), IMPORTS)
def test_a_command_imports_no_heavy_library_that_it_does_not_use(arguments, expected):
    program = (
        "import sys; from executive.cli.entry import main\n"
        f"sys.argv = ['errand', *{arguments!r}]\n"
        "try: main()\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        f"print(*sorted({{name.split('.')[0] for name in sys.modules}} & {HEAVY!r}))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert set(run.stdout.splitlines()[-1].split()) == expected

"""What the tests of reports share."""
import pathlib
import subprocess


def write_report(cairn, folder, map_path, *arguments):
    """The path of FOLDER/report.html, made with these arguments."""
    page = pathlib.Path(folder) / 'report.html'
    run = subprocess.run([cairn, 'report', map_path, '-o', str(page), *arguments], capture_output=True, text=True)
    if run.returncode != 0:
        raise AssertionError(run.stderr)
    return page

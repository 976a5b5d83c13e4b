"""
The command line at work
========================

What the program does, prints and draws, on three frames of the demo clip. Each call
below is what one would type; `run` shows it and what came back.
"""

import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import unsmear

folder = Path(tempfile.mkdtemp())
clip = unsmear.demo_clip()
window = (slice(1, 4), slice(40, 150), slice(90, 234))
unsmear.write_frames(folder / "frames", clip.blurred[window])
unsmear.write_flow(folder / "truth.flo", clip.flow[2][window[1:]])


def run(command: str) -> None:
    """Run a command in the folder and show it as a terminal would."""
    print(f"$ {command}")
    program, *arguments = shlex.split(command)
    done = subprocess.run(
        [sys.executable, "-m", program, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    print(done.stdout + done.stderr)


# %%
# The motion of one frame, how far it is from the truth, and a picture of it.

run("unsmear flow frames -o flow.flo --index 1 --plot flow.png")
run("unsmear evaluate flow.flo truth.flo")
run("unsmear show flow.flo -o arrows.png --arrows frames/frame_0001.png")

# %%
# All frames restored, and a page to look at: before and after under a slider, the flow
# under the pointer, the verdict, and the command that repeats it.

run("unsmear deblur frames -o sharp --report report.html")
size = (folder / "report.html").stat().st_size
print(f"report.html: {size / 1e6:.1f} MB, one file")

# %%
# A mistake ends with a sentence and status 1.

run("unsmear flow nowhere -o flow.flo")

figure, axes = plt.subplots(1, 3, figsize=(13, 3.4), layout="constrained")
names = ("flow.png", "arrows.png", "sharp/frame_0001.png")
for axis, name in zip(axes, names, strict=True):
    axis.imshow(unsmear.read_image(folder / name))
    axis.set_title(name)
    axis.set_axis_off()
plt.show()

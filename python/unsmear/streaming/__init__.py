"""Clips from file to file in bounded memory; `unsmear.deblur_clip` is its face.

| module       | task                                                              |
|--------------|-------------------------------------------------------------------|
| readers      | frames of any source, one after the other                         |
| clock        | when they are shown                                               |
| clip         | frames by their number, the last few kept; a first pass checks all |
| restorers    | restored frames, one after the other                              |
| part_folder  | what is finished, on disk until the target is in place            |
| writer       | folders, TIFF and GIF                                             |
| video_writer | videos, with depth, clock, colours and sound of the source        |
| deblur_clip  | all of it together                                                |
"""

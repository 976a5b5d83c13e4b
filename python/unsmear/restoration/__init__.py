"""The restoration of clips, step by step; `unsmear.deblur_sequence` is its face.

| module         | step                                                            |
|----------------|-----------------------------------------------------------------|
| source         | frames in grey levels                                           |
| bars           | black rows and columns that are no picture                      |
| sampling       | pictures and fields between pixels                              |
| looks          | what the solver takes                                           |
| stillness      | what stands still although flow says that it moves              |
| clip_motion    | velocity and acceleration of every frame                        |
| clip_exposure  | exposure of every frame, smoothed in time                       |
| line_pairing   | lines of interlaced frames that lie closer in pairs             |
| clipping       | whether what is clipped was brighter than white                 |
| walks          | every frame restored with growing strength of the prior         |
| twin_frames    | how well a restored frame predicts its neighbours' restorations |
| verdict        | what to use, where, in words                                    |
| boundaries     | what a restoration is worth where two motions meet              |
| chain          | the order of the steps                                          |
| passes         | flow measured again on restored frames                          |
| alternatives   | other exposures, where the search was not sure                  |
| registration   | smooth displacements between restored frames                    |
| neighbours     | what frames next to one show of it                              |
| joint          | several frames restored as one                                  |
| agreement      | means along the motion, against flicker                         |
| several_frames | these three in order                                            |
| records, memo  | what goes in and comes out; what is kept                        |
"""

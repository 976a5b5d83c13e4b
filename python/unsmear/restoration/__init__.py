"""The restoration of clips, step by step; `unsmear.deblur_sequence` is its face.

| module       | step                                                             |
|--------------|------------------------------------------------------------------|
| source       | frames in grey levels                                            |
| sampling     | pictures and fields between pixels                               |
| looks        | what the solver takes                                            |
| clip_motion  | velocity and acceleration of every frame                         |
| clip_exposure| exposure of every frame, smoothed in time                        |
| twin_frames  | how well a restored frame predicts its neighbours' restorations  |
| joint        | several frames restored as one                                   |
| verdict      | what to use, where, in words                                     |
| chain        | the order of the steps                                           |
| records, memo| what goes in and comes out; what is kept                         |
"""

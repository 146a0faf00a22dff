"""The proof: concealed effects drawn at random, diagnosed from the recordings alone, and a scoreboard.

Three kinds of processes that know nothing of each other: the truth (`concealed/draw.py`, other formulations
than ours, imports nothing of this package) writes recordings into a case's folder and the answer into a sealed one; the
diagnosis (`python -m origami_proof.case FOLDER`) gets the case's folder, and an audit hook stops it if it opens an
answer; the score opens the answers at the end, and checks them against digests that were taken when they were drawn.

    command.py  `origami-proof`
    case.py     the diagnosis of one case, in a process of its own
    battery.py  drawing and diagnosing many, here or on a cluster
    freeze.py   thresholds and sources of the diagnosis that a run belongs to
    score.py    what came of each case, and the scoreboard
    figures.py  its pictures
    rejudge.py  opened cases judged anew from what they stored, with other hyperparameters
"""

DEVELOPMENT = 1000
"""Seeds below this are for development; a seed from here on is sealed: it counts once."""

KINDS = ("single", "null", "outside", "confounded", "double", "beside")
RIGID = ("hanging_strip", "pendulum_chain", "magnetic_strip", "box", "bi_fold", "crawler")
STRUCTURES = (*RIGID, "mae_cantilever", "de_bender", "crease_coupon")
"""As the truth names them."""

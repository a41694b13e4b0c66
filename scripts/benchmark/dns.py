"""A direct numerical simulation by fluidsim for the benchmark: dns.py SEED OUT.npy, run by `make`.

The flow of Taylor and Green with noise of a tenth of its velocity, on 96^3 points without forcing, at a Reynolds number
of 400 by the wavenumber 1, until time 5. Writes u, v, w as an array (3, z, y, x) over the periodic cube.
Needs fluidsim with its FFTs: pip install "fluidsim[fft]".
"""
import os
import sys
import tempfile

try:
    os.environ["FLUIDSIM_PATH"] = tempfile.mkdtemp()
    import numpy
    from fluidsim.solvers.ns3d.solver import Simul
except ImportError as missing:
    sys.exit(f'{missing}; wanted a Python with fluidsim: pip install "fluidsim[fft]"')

N, REYNOLDS, END, NOISE = 96, 400, 5, 0.1
params = Simul.create_default_params()
for axis in "xyz":
    setattr(params.oper, f"n{axis}", N)
    setattr(params.oper, f"L{axis}", 2 * numpy.pi)
params.oper.type_fft = "fft3d.with_pyfftw"
params.nu_2 = 1 / REYNOLDS
params.time_stepping.t_end, params.time_stepping.type_time_scheme = END, "RK4"
params.init_fields.type = "in_script"
params.output.HAS_TO_SAVE = False
sim = Simul(params)
x, y, z = sim.oper.get_XYZ_loc()
# Noise of the largest scales: wavenumbers up to 4, without divergence after the projection.
random = numpy.random.default_rng(int(sys.argv[1]))
low = (sim.oper.Kx**2 + sim.oper.Ky**2 + sim.oper.Kz**2 <= 16).astype(float)
noise = [sim.oper.ifft(low * sim.oper.fft(random.standard_normal(x.shape))) for _ in range(3)]
noise = [NOISE * part / part.std() for part in noise]
green = [numpy.sin(x) * numpy.cos(y) * numpy.cos(z), -numpy.cos(x) * numpy.sin(y) * numpy.cos(z), 0 * x]
start = [sim.oper.fft(a + b) for a, b in zip(green, noise)]
sim.state.init_statespect_from(**dict(zip(("vx_fft", "vy_fft", "vz_fft"), start)))
sim.project_state_spect(sim.state.state_spect)
sim.state.statephys_from_statespect()
sim.time_stepping.start()
velocity = [sim.state.state_phys.get_var(f"v{axis}") for axis in "xyz"]
numpy.save(sys.argv[2], numpy.array(velocity, numpy.float32))

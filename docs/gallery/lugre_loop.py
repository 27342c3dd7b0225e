"""Presliding of the LuGre friction

Before the piston slides, the seals bend: friction over the position is a loop, Eqs. (2) and (3). The equations are
called as they are, with numbers in place of symbols.
"""

import matplotlib.pyplot as plt
import numpy as np

import clutchid
from clutchid.model.friction import deflection_rate, friction_force

p, dt = clutchid.Parameters(), 5e-3
t = np.arange(0.0, 3.0, dt)
figure, axes = plt.subplots(figsize=(7, 3.6))
for amplitude in (0.1e-3, 0.4e-3, 1.5e-3):
    v = amplitude * np.pi * np.cos(np.pi * t)
    z, force = 0.0, np.empty_like(t)
    for k, speed in enumerate(v):
        z_dot = float(deflection_rate(speed, z, p.K_z, p.F_C))
        force[k] = friction_force(speed, z, z_dot, p.D_v, p.K_z, p.D_zdot)
        z += dt * z_dot
    late = t > 1.0
    axes.plot(amplitude * np.sin(np.pi * t[late]) * 1e3, force[late], label=f"± {amplitude * 1e3:g} mm")
axes.set(xlabel="position [mm]", ylabel="friction [N]")
axes.legend(loc="upper left")

"""Order of states and parameters in the arrays of the compiled loop; needs no SymPy."""

#: States of the plant, see `clutchid.truck.plant`.
STATES = ("y", "v", "m_A", "U_A", "m_B", "U_B", "m_S", "U_S", "z", "z_h", "x_s", "x_e", "p_G")
#: Inputs, constant over a tick: rates of both lifts and of the governor's pressure.
INPUTS = ("r_s", "r_e", "r_G")
#: Further states with `ledger`: mass and energy that have entered across the boundary of the plant.
LEDGER = ("m_in", "E_in")

#: Parameters of a truck in the equations; y_r follows from its age.
PARAMETERS = (
    "A_A", "A_B", "V_0A", "V_0B", "y_max", "y_r", "M", "R", "gamma", "P_0", "T_0", "T_w", "h_A", "h_B", "V_S", "G_S",
    "UA_S", "C_s", "b_s", "m_s", "C_e", "b_e", "m_e", "C_r", "b_r", "m_r", "r_lam", "C_AB", "C_A0", "F_C", "c_F", "R_S",
    "v_S", "K_z", "D_z", "v_z", "D_v", "beta", "F_h", "mu_h", "K_h", "K_stop", "chi",
)  # fmt: skip

#: Further parameters of the loop, in the order of its array.
SETTINGS = (
    "period", "timer", "bang_bang", "working", "P_S", "dP_G", "r_up", "r_down", "t_1s", "t_2s", "t_3s", "t_4s", "t_1e",
    "t_2e", "t_3e", "t_4e", "dead_s", "dead_e", "zero", "quantum", "tau_y", "tau_p", "band", "lead", "e_in", "e_out",
)  # fmt: skip

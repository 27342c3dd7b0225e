"""Order of states and parameters in the arrays of the compiled loop of family B; needs no SymPy."""

#: States of the plant, see `clutchid.truck.second.plant`.
STATES = (
    "y", "v", "m_A", "p_A", "m_D", "p_D", "m_B", "p_B", "p_S", "x_R", "z_1", "z_2", "z_3", "z_4", "z_b", "z_f", "x_s",
    "x_e",
)  # fmt: skip
#: Inputs, constant over a tick: rates of both openings.
INPUTS = ("r_s", "r_e")

#: Parameters of a truck in the equations; y_r follows from its age.
PARAMETERS = (
    "A_A", "A_B", "V_0A", "V_D", "V_0B", "y_max", "y_r", "M", "R", "gamma", "n_p", "tau_w", "P_0", "T_0", "T_w", "A_s",
    "A_e", "A_r", "C_t", "dp_t", "r_lam", "C_AB", "C_A0", "V_S", "p_T", "A_R", "dp_R", "tau_R", "P_S", "F_C", "F_p",
    "p_F", "R_S", "v_S", "K_z", "D_z", "x_b", "plastic", "D_v", "v_g", "T_V", "B_V", "F_b", "mu_b", "K_b", "mu_f",
    "K_f", "K_stop", "chi",
)  # fmt: skip

#: Further parameters of the loop, in the order of its array.
SETTINGS = (
    "period", "timer", "bang_bang", "continuous", "spool", "second_order", "tau_x", "t_n", "zeta_x", "x_0s", "x_0e",
    "n_x", "tau_is", "t_xs", "tau_ie", "t_xe", "f_x", "dead_s", "dead_e", "zero", "quantum", "rest", "stroke", "e_lin",
    "tau_y", "tau_p", "band", "lead", "e_in", "e_out",
)  # fmt: skip

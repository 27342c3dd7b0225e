"""`Vehicle`: the parameters that all virtual trucks have, and how parameters are checked and changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import Field, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

from clutchid.arguments import is_number
from clutchid.errors import ParameterError
from clutchid.names import check_names
from clutchid.parameters import Row
from clutchid.truck.rows import FACTS, PAPER, choice, number

if TYPE_CHECKING:
    from clutchid.truck.parts import Parts

#: Zero of the position sensor: learned at the vented rest of each recording, or kept from the new clutch.
ZEROS = ("learned", "kept")


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """Parameters in SI that all trucks have; the `parts` of a truck add their own, see `clutchid.truck.kinds`.

    `wear` and `cycles` are its age, see `clutchid.truck.aged`; all other parameters are those of the new truck.
    """

    parts: ClassVar[Parts]

    # actuator
    A_A: float = number(12.3e-3, "m²", "area of the piston in chamber A", 1e-3, 0.1, PAPER)
    A_B: float = number(11.848e-3, "m²", "area of the piston in chamber B", 1e-3, 0.1, PAPER)
    V_0A: float = number(0.148e-3, "m³", "volume of chamber A at the engaged rest of the new clutch", 1e-5, 1e-2, PAPER)
    V_0B: float = number(1.2e-4, "m³", "dead volume of chamber B at full stroke", 1e-5, 1e-2, PAPER)
    y_max: float = number(0.025, "m", "stroke from the rest of the new clutch to the far stop", 0.021, 0.1, PAPER)
    M: float = number(10.0, "kg", "moving mass", 0.1, 100, PAPER)
    # air
    R: float = number(287.05, "J/(kg·K)", "gas constant of air", 200, 400, "textbook")
    gamma: float = number(1.4, "1", "ratio of specific heats of air", 1.001, 2, "textbook")
    P_0: float = number(1.013e5, "Pa", "ambient pressure", 5e4, 1.2e5, "sea level")
    T_0: float = number(293.15, "K", "ambient temperature", 213.15, 383.15)
    dT_w: float = number(5.0, "K", "temperature of the actuator wall above ambient", 0, 60, "assumption")
    # supply
    P_S: float = number(9e5, "Pa", "set supply pressure, mean of the governor's saw-tooth", 3e5, 1.6e6, PAPER)
    # valves
    r_lam: float = number(0.995, "1", "pressure ratio above which a flow is laminar", 0.95, 0.9999, "regularisation")
    C_AB: float = number(1e-12, "m³/(Pa·s)", "leak past the piston seal", 0, 1e-7)
    C_A0: float = number(5e-13, "m³/(Pa·s)", "leak from chamber A to ambient", 0, 1e-7)
    # friction
    F_C: float = number(140.0, "N", "Coulomb friction of the seals without pressure", 0.01, 5e3)
    D_v: float = number(4000.0, "N·s/m", "viscous friction at 293.15 K", 0, 2e4, "2000 to 5000")
    R_S: float = number(1.35, "1", "ratio of static to Coulomb friction", 1, 3)
    v_S: float = number(0.01, "m/s", "Stribeck velocity", 1e-4, 1)
    K_z: float = number(1e6, "N/m", "stiffness of the seals", 1e4, 1e7, PAPER)
    # clutch
    F_r: float = number(40.0, "N", "return spring: preload at the rest of the new clutch", 1, 500, "shared data, 30 N")
    k_r: float = number(1500.0, "N/m", "return spring: stiffness", 0, 1e4, "assumption")
    K_stop: float = number(1.15e9, "N/m^1.5", "end stops: contact", 1e7, 2e10, "0.3 mm at full pressure")
    chi: float = number(4.0, "s/m", "end stops: damping", 0, 100, "Hunt and Crossley")
    # age
    wear: float = number(0.0, "m", "wear of the facing", 0, 1)
    cycles: float = number(0.0, "1", "number of strokes", 0, 1e8)
    w_max: float = number(3.5e-3, "m", "largest wear of the facing", 1e-4, 0.02, "assumption")
    i_w: float = number(0.3, "1", "shift of the engaged rest per wear; 6.3 without an adjuster", 0, 10, FACTS)
    a_F: float = number(0.25, "1", "relative increase of seal friction per million strokes", 0, 5, "assumption")
    a_C: float = number(1.5, "1", "relative increase of leakage per million strokes", 0, 50, "assumption")
    a_H: float = number(0.008, "1", "final relaxation of the springs", 0, 0.1, "assumption, 1 to 2 % of load")
    # sensors
    q_y: float = number(1.2e-5, "m", "position: quantum", 0, 1e-3)
    s_y: float = number(2e-5, "m", "position: white noise, rms", 0, 1e-3)
    tau_y: float = number(1.5e-3, "s", "position: lag", 0, 0.1)
    e_y: float = number(0.0, "m", "position: error of the estimated zero", -1e-3, 1e-3, "assumption")
    q_p: float = number(500.0, "Pa", "pressure: quantum", 0, 1e5, "assumption")
    s_p: float = number(3000.0, "Pa", "pressure: white noise, rms", 0, 1e5)
    tau_p: float = number(1.5e-3, "s", "pressure: lag", 0, 0.1)
    e_p: float = number(0.0, "Pa", "pressure: offset", -2e4, 2e4, "assumption")
    e_clock: float = number(2e-5, "1", "bus clock: drift", -1e-3, 1e-3, "quartz")
    j_clock: float = number(3e-4, "s", "bus clock: jitter of a message", 0, 5e-3, "assumption")
    # controller
    T_pwm: float = number(0.01, "s", "period over which the duty cycles are held", 1e-3, 0.1)
    L_p: float = number(5e-3, "m", "error at which a valve is fully open", 1e-4, 0.05, "tuned")
    t_lead: float = number(0.012, "s", "prediction time of the controller", 0, 0.1, "tuned")
    e_in: float = number(0.12e-3, "m", "error below which both valves close", 0, 5e-3, "tuned")
    e_out: float = number(0.25e-3, "m", "error above which a valve opens again", 0, 5e-3, "tuned")
    zero: str = choice("learned", ZEROS)

    def __post_init__(self) -> None:
        problems = [text for item in fields(self) for text in self._checked(item)]
        if not problems:
            problems = [*self._contradictions()]
        ParameterError.raise_for(problems)

    def _checked(self, item: Field[Any]) -> list[str]:
        name, value = item.name, getattr(self, item.name)
        if "variants" in item.metadata:
            variants = item.metadata["variants"]
            return [] if value in variants else [f"{name} = {value!r}: must be one of {', '.join(variants)}."]
        row: Row = item.metadata["row"]
        if not is_number(value):
            return [f"{name} = {value!r}: a number in {row.unit} is needed ({row.meaning})."]
        object.__setattr__(self, name, float(value))
        if row.admits(float(value)):
            return []
        unit = "" if row.unit == "1" else f" {row.unit}"
        return [f"{name} = {value:g}{unit}: {row.meaning} is {row.allowed}{unit}."]

    def _contradictions(self) -> Iterator[str]:
        """Contradictions between parameters that are admissible individually."""
        worn = f"wear = {self.wear * 1e3:g} mm"
        if self.A_B > self.A_A:
            yield f"A_B = {self.A_B:g} m² must not exceed A_A = {self.A_A:g} m²: the rod reduces the area of chamber B."
        if self.wear > self.w_max:
            yield f"{worn} exceeds the facing of this truck, which can wear by {self.w_max * 1e3:g} mm; renew the disc."
        if 1.1 * self.A_A * self.i_w * self.wear >= self.V_0A:
            yield f"{worn} with i_w = {self.i_w:g} moves the rest beyond the end of chamber A."
        if self.e_in > self.e_out:
            yield f"e_in = {self.e_in:g} m must not exceed e_out = {self.e_out:g} m."
        for part in self.parts:
            yield from part.contradictions(self)

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of all parameters that are numbers, in the order of the table."""
        return tuple(item.name for item in fields(cls) if "row" in item.metadata)

    @classmethod
    def row(cls, name: str) -> Row:
        """The row of the parameter `name`.

        Raises
        ------
        ParameterError
            If there is no such parameter; the text names the nearest known one.
        """
        check_names([name], cls.names(), "parameter of a truck")
        row: Row = next(item.metadata["row"] for item in fields(cls) if item.name == name)
        return row

    def replace(self, changes: Mapping[str, Any]) -> Self:
        """A copy with changed values, validated again.

        Raises
        ------
        ParameterError
            For an unknown name or an impossible value.
        """
        check_names(changes, [item.name for item in fields(self)], "parameter of a truck")
        return replace(self, **changes)

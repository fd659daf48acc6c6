"""Marker set of a laboratory, for both arms."""

from maniport.mocap import MARKER_SETS

MARKER_SETS["our lab"] = {
    "shoulder": ["Acromion_R"],
    "elbow": [["Epi_Lat_R", "Epi_Med_R"], ["Epi_Lat_R"]],  # the mean of both, or the first alone
    "wrist": [["Styloid_Rad_R", "Styloid_Uln_R"]],
    "elbow_axis": [("Epi_Med_R", "Epi_Lat_R")],
    "wrist_axis": [("Styloid_Uln_R", "Styloid_Rad_R")],
    "trunk_up": [("Sacrum", "Vertebra_7")],
    "trunk_left": [("Acromion_R", "Acromion_L")],
}

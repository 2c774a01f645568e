#!/usr/bin/python3
"""./acopla bench: studies of accuracy and speed, each with its targets.

    ./acopla bench --list
    ./acopla bench NAME [--quick]

A study writes docs/evidence/NAME.md, .csv and .svg and ends with `NAME: met M of N`; the exit code is 1 when a target is
missed. --quick shrinks the problem, never a tolerance, and writes beside the build instead.
"""
import argparse
import importlib
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from study import Study  # noqa: E402

STUDIES = {
    "box_fill": "spheres fill a steel box: tables 4-4 to 4-11 of Nasato (2011), conservation, cost of the search",
    "coupling": "two-way coupling: orders, schemes over mass and stiffness ratios, what a window costs beside bare messages",
    "dem_accuracy": "the DEM against closed forms, ODEs, statics and Gomes's piles (2014, chapter 3): error against step and run time",
    "dem_stability": "what steps the particles stand: limits of every law, extremes of every parameter, and whether what breaks says so",
    "dem_speed": "particle-steps per second on a settled bed against LAMMPS and LIGGGHTS; what each feature, thread and triangle costs",
    "fem": "the structure: error against run time of every element, static and in motion; CalculiX on the same mesh; what a window costs",
}


def main():
    parser = argparse.ArgumentParser(prog="acopla bench", description="Studies of accuracy and speed.")
    parser.add_argument("name", nargs="?", choices=sorted(STUDIES))
    parser.add_argument("--list", action="store_true", help="the studies and what they are about")
    parser.add_argument("--quick", action="store_true", help="a smaller problem with the same tolerances")
    parser.add_argument("--build", default="build/release", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.list or not given.name:
        for name, about in sorted(STUDIES.items()):
            print(f"{name:12} {about}")
        return 0 if given.list else 2
    study = Study(given.name, STUDIES[given.name], pathlib.Path(given.build).resolve(), given.quick)
    importlib.import_module(f"{given.name}_study").run(study)
    return study.finish()


if __name__ == "__main__":
    sys.exit(main())

"""Reads a VTKHDF time series with h5py and with VTK's own reader, and prints what it finds.

usage: python scripts/check_vtkhdf.py fields.vtkhdf

Prints one line for each step: number, time, points, and for each point array its components,
smallest and largest value and sum, with all digits. Ends with an error if the two readers
disagree in a single bit. Needs the packages numpy, h5py and vtk.
"""

import sys

import h5py
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader


def main(path):
    reader = vtkHDFReader()
    reader.SetFileName(path)
    reader.UpdateInformation()
    info = reader.GetOutputInformation(0)
    times = info.Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()
    with h5py.File(path, "r") as file:
        root = file["VTKHDF"]
        steps = root["Steps"]
        values = tuple(steps["Values"][:])
        if len(values) == 1:
            # of a file with one step the reader tells no time
            times = values
        assert values == tuple(times), "the times differ"
        assert steps.attrs["NSteps"] == len(times), "NSteps differs"
        n = int(root["NumberOfPoints"][0])
        for s, time in enumerate(times):
            reader.SetStep(s)
            reader.Update()
            grid = reader.GetOutput()
            assert grid.GetNumberOfPoints() == n and grid.GetNumberOfCells() == n
            points = vtk_to_numpy(grid.GetPoints().GetData())
            assert np.array_equal(points, root["Points"][:]), "the points differ"
            number = grid.GetFieldData().GetArray("step").GetValue(0)
            assert number == root["FieldData/step"][s], "the step number differs"
            print(f"step {number} time {time!r} points {n}")
            for name, data in sorted(root["PointData"].items()):
                start = int(steps["PointDataOffsets"][name][s])
                expected = data[start : start + n]
                array = grid.GetPointData().GetArray(name)
                assert array is not None, f"VTK does not see {name}"
                values = vtk_to_numpy(array)
                assert values.dtype == expected.dtype, f"the type of {name} differs"
                assert np.array_equal(values, expected, equal_nan=True), f"{name} differs"
                components = 1 if values.ndim == 1 else values.shape[1]
                unit = data.attrs.get("units", b"-")
                unit = unit.decode() if isinstance(unit, bytes) else unit
                low, high = values.min().item(), values.max().item()
                # Row by row, so that the sum has one defined order.
                total = 0
                for value in values.ravel().tolist():
                    total += value
                print(f"  {name} components {components} min {low!r} max {high!r} sum {total!r} unit {unit}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])

"""A block of tissue with a part labelled `resected`, as VTU with a scenario: what no case of the tests has."""

SCENARIO = """fixed = ['base']
[materials.grey_matter]
law = 'neo-hookean'
shear_modulus_pa = 1370.0
poisson_ratio = 0.45
[materials.resected]
law = 'neo-hookean'
shear_modulus_pa = 3000.0
poisson_ratio = 0.45
[loads]
gravity_m_per_s2 = [0.0, 0.0, -9.81]
"""
#: Cells along x, y, z, and their edge in mm.
CELLS, EDGE = (4, 4, 5), 10


def write(folder):
    """Mesh and scenario in a folder; their paths."""
    nx, ny, nz = CELLS
    nodes = [(EDGE * i, EDGE * j, EDGE * k) for k in range(nz + 1) for j in range(ny + 1) for i in range(nx + 1)]
    tets, labels = [], []
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                corner = lambda b: i + (b & 1) + (nx + 1) * (j + (b >> 1 & 1) + (ny + 1) * (k + (b >> 2)))  # noqa: E731
                for a, b in [(1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)]:
                    tets.append([corner(0), corner(a), corner(b), corner(7)])
                    labels.append(5 if i >= 2 and k == nz - 1 else 2)

    def array(kind, name, values, components=1):
        return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="ascii">{" ".join(map(str, values))}</DataArray>'

    flat = [n for tet in tets for n in tet]
    sets = {"base": [int(p[2] == 0) for p in nodes], "margin": [int(p[2] == EDGE * (nz - 1) and p[0] >= 2 * EDGE) for p in nodes]}
    text = f"""<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>
<Piece NumberOfPoints="{len(nodes)}" NumberOfCells="{len(tets)}">
<Points>{array("Float64", "Points", [x for p in nodes for x in p], 3)}</Points>
<Cells>{array("Int64", "connectivity", flat)}{array("Int64", "offsets", range(4, len(flat) + 1, 4))}{array("UInt8", "types", [10] * len(tets))}</Cells>
<PointData>{"".join(array("UInt8", name, values) for name, values in sets.items())}</PointData>
<CellData>{array("Int32", "label", labels)}</CellData>
</Piece></UnstructuredGrid></VTKFile>
"""
    mesh, scenario = folder / "block.vtu", folder / "block.toml"
    mesh.write_text(text)
    scenario.write_text(SCENARIO)
    return [str(mesh), str(scenario)]

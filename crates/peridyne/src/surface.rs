//! Surfaces of a deck: from generators and mesh files to points with normals and areas.

use crate::deck::{self, Deck, Issue, SurfaceShape, SurfaceSource};
use bodies::points::PointCloud;
use std::io::{BufRead, BufReader, Cursor};
use std::path::Path;
use thin::ThinError;
use thin::generate;
use thin::surface::Surface;

/// The surface of a source of points.
///
/// # Errors
/// What is wrong with the shape or the file.
pub fn of(deck: &Deck, source: &SurfaceSource) -> Result<Surface, Vec<Issue>> {
    let fault = |e: ThinError| vec![Issue::new(source.span, e.to_string(), "correct the surface accordingly")];
    let pair = |c: &[deck::Count; 2]| [c[0].value as usize, c[1].value as usize];
    let lengths = |q: &[deck::Quantity<deck::Length>; 2]| [q[0].value, q[1].value];
    let angles = |q: &[deck::Quantity<deck::Angle>; 2]| [q[0].value, q[1].value];
    let made = match &source.shape {
        SurfaceShape::Panel(s) => generate::panel(lengths(&s.size), pair(&s.cells)),
        SurfaceShape::TwoResolutions(s) => {
            generate::two_resolution_panel(lengths(&s.size), pair(&s.cells), s.split.value * s.size[0].value)
        }
        SurfaceShape::Cylinder(s) => generate::cylinder(s.radius.value, s.length.value, angles(&s.around), pair(&s.cells)),
        SurfaceShape::Sphere(s) => generate::sphere(s.radius.value, angles(&s.polar), angles(&s.azimuth), s.cells.value as usize),
        SurfaceShape::Torus(s) => generate::torus(s.radius.value, s.tube.value, pair(&s.cells)),
        SurfaceShape::Ring(s) => generate::ring(s.radius.value, angles(&s.around), s.cells.value as usize),
        SurfaceShape::Line(s) => {
            let cells = s.cells.value as usize;
            let shares: Vec<f64> = (0..=cells).map(|k| k as f64 / cells as f64).collect();
            let (from, to) = (s.from.point(), s.to.point());
            // it bends in the plane of x and y, or both ways
            let upright = (0..2).all(|k| from[k] == to[k]);
            generate::line(from, to, &shares, if upright { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] })
        }
        SurfaceShape::Mesh(s) => {
            let path = deck.resolve(&s.path.value);
            let (vertices, triangles) =
                read_mesh(&path).map_err(|why| vec![Issue::new(s.path.span, why, "give a file of triangles, STL or OBJ")])?;
            let vertices: Vec<[f64; 3]> = vertices.into_iter().map(|x| x.map(|c| c * s.scale.value)).collect();
            Surface::from_triangles(&vertices, &triangles, s.closeness.value)
        }
    };
    let mut surface = made.map_err(fault)?;
    if let Some(jitter) = &source.jitter {
        // points of named edges stay
        let mut fixed = vec![false; surface.len()];
        surface.sets.values().flatten().for_each(|&p| fixed[p as usize] = true);
        generate::jitter(&mut surface, jitter.amplitude.value, jitter.seed.value, |p| fixed[p as usize]);
    }
    for region in &source.minus {
        let inside = crate::problem::region_of(region);
        surface = generate::remove(&surface, |x| inside(*x));
    }
    if let Some(place) = &source.place {
        let unit = |q: &[deck::Quantity<deck::Number>; 3]| {
            let v = q.each_ref().map(|q| q.value);
            let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
            v.map(|x| x / length)
        };
        let (x, y) = (unit(&place.x), unit(&place.y));
        let z = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
        surface = surface.moved(place.origin.each_ref().map(|q| q.value), [x, y, z]).map_err(|_| {
            vec![Issue::new(place.span, "the directions `x` and `y` are not at a right angle", "give two that are, of any length")]
        })?;
    }
    if surface.is_empty() {
        return Err(vec![Issue::new(source.span, "no points are left", "the holes remove the whole surface: check `minus`")]);
    }
    Ok(surface)
}

/// A surface or curve of a structure.
pub struct Part {
    /// Name of its block.
    pub name: String,
    /// Its points.
    pub surface: Surface,
    /// Number of its first point.
    pub first: usize,
}

/// The surfaces of a deck, one after another, and all as one.
///
/// # Errors
/// What is wrong with their shapes and names.
pub fn parts(deck: &Deck, sources: &[&SurfaceSource]) -> Result<(Vec<Part>, Surface), Vec<Issue>> {
    let (mut parts, mut issues): (Vec<Part>, Vec<Issue>) = (vec![], vec![]);
    for source in sources {
        let name = source.block.as_ref().map_or_else(|| "surface".into(), |b| b.value.clone());
        if source.block.is_none() && sources.len() > 1 {
            issues.push(Issue::new(source.span, "one of several surfaces has no name", "name each with `block: …`"));
        } else if parts.iter().any(|p| p.name == name) {
            issues.push(Issue::new(source.span, format!("two surfaces are called `{name}`"), "give each a name of its own"));
        }
        match of(deck, source) {
            Ok(surface) => {
                let first = parts.last().map_or(0, |p: &Part| p.first + p.surface.len());
                parts.push(Part { name, surface, first });
            }
            Err(e) => issues.extend(e),
        }
    }
    if !issues.is_empty() {
        return Err(issues);
    }
    let whole = match parts.as_slice() {
        [one] => one.surface.clone(),
        _ => Surface::together(&parts.iter().map(|p| (p.name.as_str(), &p.surface)).collect::<Vec<_>>()),
    };
    Ok((parts, whole))
}

/// The points of surfaces as a cloud; areas (lengths) are their volumes.
pub fn cloud(parts: &[Part], surface: &Surface, dimension: usize) -> PointCloud {
    let n = surface.len();
    PointCloud {
        dimension,
        position: surface.positions.clone(),
        volume: surface.measure.clone(),
        spacing: surface.spacing.clone(),
        block: parts.iter().enumerate().flat_map(|(k, p)| vec![k as u32; p.surface.len()]).collect(),
        block_names: parts.iter().map(|p| p.name.clone()).collect(),
        id: (0..n as u64).collect(),
        lattice: None,
    }
}

type Mesh = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Corners and triangles of an STL or OBJ file.
fn read_mesh(path: &Path) -> Result<Mesh, String> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let bytes = std::fs::read(path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    match ending.as_str() {
        "stl" => {
            let mesh = stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|e| format!("{} is no STL file: {e}", path.display()))?;
            let vertices = mesh.vertices.iter().map(|v| v.0.map(f64::from)).collect();
            let faces = mesh.faces.iter().map(|f| f.vertices.map(|v| v as u32)).collect();
            Ok((vertices, faces))
        }
        "obj" => {
            let mut reader: Box<dyn BufRead> = Box::new(BufReader::new(Cursor::new(bytes)));
            let options = tobj::LoadOptions { triangulate: true, single_index: false, ..Default::default() };
            // materials colour pictures; they are not looked for
            let none = |_: &Path| -> tobj::MTLLoadResult { Err(tobj::LoadError::OpenFileFailed) };
            let (models, _) =
                tobj::load_obj_buf(&mut reader, &options, none).map_err(|e| format!("{} is no OBJ file: {e}", path.display()))?;
            let (mut vertices, mut faces): Mesh = (vec![], vec![]);
            // every model of a file has the vertices of the whole file that it uses
            let mut known: std::collections::HashMap<[u64; 3], u32> = std::collections::HashMap::new();
            for model in &models {
                let mesh = &model.mesh;
                let corner: Vec<u32> = mesh
                    .positions
                    .chunks_exact(3)
                    .map(|x| {
                        let place = [x[0], x[1], x[2]];
                        *known.entry(place.map(f64::to_bits)).or_insert_with(|| {
                            vertices.push(place);
                            vertices.len() as u32 - 1
                        })
                    })
                    .collect();
                faces.extend(mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|v| corner[v as usize])));
            }
            // corners that no triangle uses are no points
            let mut used = vec![false; vertices.len()];
            faces.iter().flatten().for_each(|v| used[*v as usize] = true);
            let mut number = vec![0; vertices.len()];
            let mut kept = vec![];
            for (v, x) in vertices.iter().enumerate().filter(|(v, _)| used[*v]) {
                number[v] = kept.len() as u32;
                kept.push(*x);
            }
            Ok((kept, faces.iter().map(|t| t.map(|v| number[v as usize])).collect()))
        }
        _ => Err(format!("the ending of {} tells no format", path.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles in both formats, one of them with a quadrilateral and a normal.
    #[test]
    fn meshes_are_read_from_both_formats() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let obj = write("a.obj", "# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n");
        let (vertices, faces) = read_mesh(&obj).unwrap();
        assert_eq!((vertices.len(), faces.len()), (4, 2));
        let facet = |t: [[f64; 3]; 3]| {
            let corner = |x: [f64; 3]| format!("vertex {} {} {}\n", x[0], x[1], x[2]);
            format!("facet normal 0 0 1\nouter loop\n{}{}{}endloop\nendfacet\n", corner(t[0]), corner(t[1]), corner(t[2]))
        };
        let (a, b, c, d) = ([0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]);
        let stl = write("a.stl", &format!("solid s\n{}{}endsolid s\n", facet([a, b, c]), facet([a, c, d])));
        let (vertices, faces) = read_mesh(&stl).unwrap();
        assert_eq!((vertices.len(), faces.len()), (4, 2), "equal corners are one");
        assert!(read_mesh(&write("b.stl", "nothing")).unwrap_err().contains("STL"));
        assert!(read_mesh(&write("b.ply", "ply")).unwrap_err().contains("format"));
        assert!(read_mesh(&folder.path().join("none.obj")).unwrap_err().contains("cannot read"));
    }
}

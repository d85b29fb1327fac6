//! Colliders of an animation.

use super::OBJ_DIGITS;
use super::names::Names;
use super::options::{ColliderMesh, TrackOptions};
use crate::Result;
use crate::file::relative;
use crate::geometry::TriMesh;
use crate::import::mesh_file::ImportedMesh;
use crate::import::source::Source;
use crate::scene::anim::file::{ColliderFile, ShapeFile};
use crate::scene::{FileSequence, UpAxis};
use std::path::PathBuf;

/// Name of the body at rest that carries deforming meshes.
pub(super) const WORLD: &str = "world";

/// Colliders and the mesh files that they refer to.
#[derive(Default)]
pub(super) struct Colliders {
    pub(super) colliders: Vec<ColliderFile>,
    /// Files to write: path and text.
    pub(super) files: Vec<(PathBuf, String)>,
    /// Names of those that roots grow on.
    pub(super) skins: Vec<String>,
    /// Remarks on the meshes.
    pub(super) notes: Vec<String>,
    /// Those of the colliders, after which their files are named.
    pub(super) names: Names,
}

impl Colliders {
    /// Whether any collider deforms and so needs the body [`WORLD`].
    pub(super) fn any_deforms(&self) -> bool {
        self.colliders.iter().any(|collider| collider.body.is_some())
    }

    /// Adds a collider. `first_file` is the file that was read, `read` its contents, `first_frame` the frame
    /// of its first sample.
    ///
    /// # Errors
    /// A path that has no absolute form.
    pub(super) fn add(
        &mut self,
        mesh: &ColliderMesh,
        first_file: &Source,
        read: &ImportedMesh,
        first_frame: i32,
        options: &TrackOptions,
    ) -> Result<()> {
        self.notes.extend(read.notes.iter().map(|note| format!("{}: {note}", mesh.source.path.display())));
        let name = self.names.unique(&mesh.name);
        self.skins.extend(mesh.is_skin.then(|| name.clone()));
        let deforms = mesh.source != *first_file || !read.samples.is_empty();
        let shape = if first_file.is_usd() || first_file.is_gltf() {
            self.write_obj(&name, read, first_frame, options)
        } else {
            ShapeFile::Mesh {
                file: relative(&first_file.path, options.folder())?,
                sequence: if deforms { Some(relative(&mesh.source.path, options.folder())?) } else { None },
                metres_per_unit: Some(read.convention.metres_per_unit),
                up_axis: Some(read.convention.up),
            }
        };
        self.colliders.push(ColliderFile {
            name,
            body: deforms.then(|| WORLD.into()),
            shape,
            friction: mesh.friction,
            static_friction: None,
            thickness_m: mesh.thickness,
        });
        Ok(())
    }

    /// Converts a USD or glTF mesh to OBJ files next to the animation, metres, Y up; the first sample is that
    /// of `first_frame`.
    fn write_obj(
        &mut self,
        name: &str,
        read: &ImportedMesh,
        first_frame: i32,
        options: &TrackOptions,
    ) -> ShapeFile {
        let (folder, name) = (options.folder(), options.name_beside(name));
        let file = format!("{name}.obj");
        self.files.push((folder.join(&file), read.mesh.to_obj(OBJ_DIGITS)));
        let sequence = (!read.samples.is_empty()).then(|| format!("{name}.####.obj"));
        if let Some(sequence) = sequence.as_deref().and_then(FileSequence::new) {
            for (frame, vertices) in (first_frame..).zip(&read.samples) {
                let mesh = TriMesh { vertices: vertices.clone(), ..read.mesh.clone() };
                self.files.push((sequence.path(folder, frame), mesh.to_obj(OBJ_DIGITS)));
            }
        }
        ShapeFile::Mesh { file, sequence, metres_per_unit: Some(1.0), up_axis: Some(UpAxis::Y) }
    }
}

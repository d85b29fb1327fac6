//! Reading a cache.

use super::frame::{ColliderFrame, CurveFrame, Frame, Reactions};
use super::header::{Basis, ClosestGuides, ColliderMesh, CurveSet, Header, HeldGuides};
use super::layers::transposed;
use super::manifest::Manifest;
use super::names::{
    ARC, ARRIVED, CAPS, CLAMP_FORCE, CLAMP_MOMENT, CLOSEST_GUIDES, GUIDE_WEIGHTS, LEVEL, LOOSE, MANIFEST,
    PLANE, SKIN, TIE_FORCE, TIE_GUIDE, TIE_MOMENT, TIE_NUMBER, TOPOLOGY, collider_prim_names,
    frame_file_name, frames_on_disk,
};
use crate::usd::{Layer, Value, crate_file};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

const HAIR: &str = "/groom/hair";
const GUIDES: &str = "/groom/guides";

/// A cache on disk, finished or not.
#[derive(Debug)]
pub struct Reader {
    dir: PathBuf,
    header: Header,
    frames: Vec<i32>,
}

impl Reader {
    /// Opens the cache in `dir`: reads its topology and lists its frame files.
    ///
    /// # Errors
    /// [`Error::BadInput`] if there is none; [`Error::Io`] if it cannot be read; [`Error::Damaged`] if the
    /// topology is not the crate file of a cache.
    pub fn open(dir: &Path) -> Result<Self> {
        let source = Source::open(dir.join(TOPOLOGY)).map_err(|error| match error {
            Error::Io { path, source } => Error::reading(path, source),
            other => other,
        })?;
        let header = source.header()?;
        Ok(Reader { dir: dir.to_path_buf(), header, frames: frames_on_disk(dir, frame_file_name)? })
    }

    /// The cache's folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// The constant part.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Frames with a file, in order, handle frames included.
    pub fn frames(&self) -> &[i32] {
        &self.frames
    }

    /// Reads one frame.
    ///
    /// # Errors
    /// [`Error::Io`] if its file is missing or cannot be read; [`Error::Damaged`] if it is not a crate file,
    /// lacks an attribute, or contradicts the header.
    pub fn read_frame(&self, frame: i32) -> Result<Frame> {
        self.source(frame)?.sample(&self.header, frame, 0.0)
    }

    /// Reads the time samples of one frame at `offsets`, frames (0..1), after it.
    ///
    /// # Errors
    /// As [`Reader::read_frame`].
    pub fn read_samples(&self, frame: i32, offsets: impl IntoIterator<Item = f64>) -> Result<Vec<Frame>> {
        let mut source = self.source(frame)?;
        offsets.into_iter().map(|offset| source.sample(&self.header, frame, offset)).collect()
    }

    fn source(&self, frame: i32) -> Result<Source> {
        Source::open(self.dir.join(frame_file_name(frame)))
    }

    /// Reads `manifest.json`, which an unfinished cache lacks.
    ///
    /// # Errors
    /// [`Error::Io`] if it is missing or cannot be read; [`Error::Damaged`] if it is not a manifest.
    pub fn read_manifest(&self) -> Result<Manifest> {
        let path = self.dir.join(MANIFEST);
        let bytes = std::fs::read(&path).map_err(|e| Error::io(&path, e))?;
        serde_json::from_slice(&bytes).map_err(|e| Error::Damaged { path, what: e.to_string() })
    }
}

/// A layer from which values are taken one by one.
struct Source {
    path: PathBuf,
    layer: Layer<'static>,
}

impl Source {
    fn open(path: PathBuf) -> Result<Self> {
        let bytes = std::fs::read(&path).map_err(|e| Error::io(&path, e))?;
        let layer = crate_file::decode(&path, &bytes)?;
        Ok(Source { path, layer })
    }

    fn header(mut self) -> Result<Header> {
        let metres_per_unit = self.stage_number("metersPerUnit")?;
        let fps = self.stage_number("timeCodesPerSecond")?;
        let frames = (self.stage_number("startTimeCode")? as i32, self.stage_number("endTimeCode")? as i32);
        let z_up = self.layer.metadata.iter().any(|(name, v)| name == "upAxis" && *v == Value::token("Z"));
        let [has_hair, has_guides] = [HAIR, GUIDES].map(|prim| self.layer.prim_mut(prim).is_some());
        let basis = match self.take(if has_guides { GUIDES } else { HAIR }, "basis", None, text)?.as_str() {
            "bspline" => Basis::Bspline,
            _ => Basis::CatmullRom,
        };
        let hair = if has_hair { Some(self.curves(HAIR)?) } else { None };
        let guides = if has_guides { self.curves(GUIDES)? } else { CurveSet::default() };
        let [levels, accelerations] =
            [LEVEL, "accelerations"].map(|name| self.has(if has_guides { GUIDES } else { HAIR }, name));
        let [steps, normals] = [ARRIVED, "normals"].map(|name| self.has(GUIDES, name));
        let reactions = if self.has(GUIDES, CLAMP_FORCE) { Some(self.held_guides()?) } else { None };
        let names = self
            .layer
            .prim_mut("/groom/colliders")
            .map(|scope| scope.children.iter().map(|mesh| mesh.name.clone()).collect::<Vec<_>>());
        let colliders =
            names.unwrap_or_default().into_iter().map(|name| self.collider(name)).collect::<Result<_>>()?;
        let header = Header {
            metres_per_unit,
            z_up,
            fps,
            frames,
            basis,
            hair,
            guides,
            colliders,
            levels,
            steps,
            accelerations,
            normals,
            reactions,
        };
        header.check().map_err(|what| self.damaged(what))?;
        Ok(header)
    }

    fn sample(&mut self, header: &Header, frame: i32, offset: f64) -> Result<Frame> {
        let time = f64::from(frame) + offset;
        let hair = match &header.hair {
            Some(_) => Some(self.moving_curves(HAIR, time, header)?),
            None => None,
        };
        let guides = match header.guides.counts.is_empty() {
            true => CurveFrame::default(),
            false => {
                let reactions = match &header.reactions {
                    Some(held) => Some(self.reactions(time, held)?),
                    None => None,
                };
                let normals = match header.normals {
                    true => Some(self.take(GUIDES, "normals", Some(time), float3s)?),
                    false => None,
                };
                let arrived = match header.steps {
                    true => Some(self.take(GUIDES, ARRIVED, Some(time), ints)?),
                    false => None,
                };
                CurveFrame { arrived, normals, reactions, ..self.moving_curves(GUIDES, time, header)? }
            }
        };
        let head = self.transform("/groom/head", time)?;
        let mut colliders = Vec::with_capacity(header.colliders.len());
        for (mesh, name) in header.colliders.iter().zip(collider_prim_names(header)) {
            let prim = format!("/groom/colliders/{name}");
            let transform = self.transform(&prim, time)?;
            let points =
                if mesh.deforms { Some(self.take(&prim, "points", Some(time), float3s)?) } else { None };
            colliders.push(ColliderFrame { transform, points });
        }
        let frame = Frame { frame, offset, hair, guides, head, colliders };
        frame.check(header).map_err(|what| self.damaged(what))?;
        Ok(frame)
    }

    fn curves(&mut self, prim: &str) -> Result<CurveSet> {
        Ok(CurveSet {
            counts: self.take(prim, "curveVertexCounts", None, ints)?,
            rest: self.take(prim, "primvars:rest", None, float3s)?,
            arc: if self.has(prim, ARC) { self.take(prim, ARC, None, floats)? } else { Vec::new() },
            widths: self.take(prim, "widths", None, floats)?,
            id: self.take(prim, "primvars:groom_id", None, ints)?,
            group: self.take(prim, "primvars:groom_group_id", None, ints)?,
            group_name: self.take(prim, "primvars:groom_group_name", None, strings)?,
            guide: self.take(prim, "primvars:groom_guide", None, ints)?,
            root_uv: self.take(prim, "primvars:groom_root_uv", None, float2s)?,
            loose: if self.has(prim, LOOSE) { self.take(prim, LOOSE, None, ints)? } else { Vec::new() },
            closest: match self.has(prim, CLOSEST_GUIDES) {
                true => ClosestGuides {
                    guides: self.take(prim, CLOSEST_GUIDES, None, ints)?,
                    weights: self.take(prim, GUIDE_WEIGHTS, None, floats)?,
                },
                false => ClosestGuides::default(),
            },
        })
    }

    fn collider(&mut self, name: String) -> Result<ColliderMesh> {
        let prim = format!("/groom/colliders/{name}");
        let triangles = self.triangles(&prim, "faceVertexIndices")?;
        let caps = if self.has(&prim, CAPS) { self.triangles(&prim, CAPS)? } else { Vec::new() };
        let deforms = self.has(&prim, "primvars:rest");
        let points = if deforms { "primvars:rest" } else { "points" };
        let points = self.take(&prim, points, None, float3s)?;
        let [is_skin, is_plane] = [SKIN, PLANE].map(|mark| self.has(&prim, mark));
        Ok(ColliderMesh { points, triangles, caps, deforms, is_skin, is_plane, name })
    }

    fn triangles(&mut self, prim: &str, name: &str) -> Result<Vec<[i32; 3]>> {
        let indices = self.take(prim, name, None, ints)?;
        match indices.as_chunks::<3>() {
            (triangles, []) => Ok(triangles.to_vec()),
            _ => Err(self.damaged(format!("{prim} has faces other than triangles"))),
        }
    }

    fn moving_curves(&mut self, prim: &str, time: f64, header: &Header) -> Result<CurveFrame> {
        Ok(CurveFrame {
            points: self.take(prim, "points", Some(time), float3s)?,
            velocities: self.take(prim, "velocities", Some(time), float3s)?,
            extent: self.take(prim, "extent", Some(time), |v| float3s(v)?.try_into().ok())?,
            level: if header.levels { Some(self.take(prim, LEVEL, Some(time), ints)?) } else { None },
            accelerations: match header.accelerations {
                true => Some(self.take(prim, "accelerations", Some(time), float3s)?),
                false => None,
            },
            arrived: None,
            normals: None,
            reactions: None,
        })
    }

    fn held_guides(&mut self) -> Result<HeldGuides> {
        if !self.has(GUIDES, TIE_GUIDE) {
            return Ok(HeldGuides::default());
        }
        Ok(HeldGuides {
            guide: self.take(GUIDES, TIE_GUIDE, None, ints)?,
            number: self.take(GUIDES, TIE_NUMBER, None, ints)?,
        })
    }

    fn reactions(&mut self, time: f64, held: &HeldGuides) -> Result<Reactions> {
        let mut of_ties = |name: &str| match held.guide.is_empty() {
            true => Ok(Vec::new()),
            false => self.take(GUIDES, name, Some(time), float3s),
        };
        Ok(Reactions {
            tie_force: of_ties(TIE_FORCE)?,
            tie_moment: of_ties(TIE_MOMENT)?,
            clamp_force: self.take(GUIDES, CLAMP_FORCE, Some(time), float3s)?,
            clamp_moment: self.take(GUIDES, CLAMP_MOMENT, Some(time), float3s)?,
        })
    }

    fn transform(&mut self, prim: &str, time: f64) -> Result<[[f64; 4]; 4]> {
        self.take(prim, "xformOp:transform", Some(time), |value| match value {
            Value::Matrix4d(rows) => Some(transposed(&rows)),
            _ => None,
        })
    }

    /// Whether a prim has an attribute.
    fn has(&mut self, prim: &str, name: &str) -> bool {
        self.layer.prim_mut(prim).is_some_and(|prim| prim.attribute_mut(name).is_some())
    }

    /// Takes the sample of an attribute at `time`, or its default.
    fn take<T>(
        &mut self,
        prim: &str,
        name: &str,
        time: Option<f64>,
        convert: impl Fn(Value<'static>) -> Option<T>,
    ) -> Result<T> {
        let attribute = self.layer.prim_mut(prim).and_then(|prim| prim.attribute_mut(name));
        let value = attribute.and_then(|attribute| match time {
            None => attribute.default.take(),
            Some(time) => {
                let at = attribute.samples.iter().position(|(of, _)| *of == time)?;
                Some(attribute.samples.swap_remove(at).1)
            }
        });
        value.and_then(convert).ok_or_else(|| {
            let at = time.map(|t| format!(" at frame {t}")).unwrap_or_default();
            self.damaged(format!("{prim}.{name} has no value of the right type{at}"))
        })
    }

    fn stage_number(&self, name: &str) -> Result<f64> {
        let value = self.layer.metadata.iter().find(|(n, _)| n == name).map(|(_, value)| value);
        match value {
            Some(Value::Double(number)) => Ok(*number),
            _ => Err(self.damaged(format!("it has no {name}"))),
        }
    }

    fn damaged(&self, what: String) -> Error {
        Error::Damaged { path: self.path.clone(), what }
    }
}

fn text(value: Value<'static>) -> Option<String> {
    match value {
        Value::Token(text) => Some(text),
        _ => None,
    }
}

fn strings(value: Value<'static>) -> Option<Vec<String>> {
    match value {
        // Older caches store the names of groups as tokens.
        Value::Strings(v) | Value::Tokens(v) => Some(v),
        _ => None,
    }
}

fn ints(value: Value<'static>) -> Option<Vec<i32>> {
    match value {
        Value::Ints(v) => Some(v.into_owned()),
        _ => None,
    }
}

fn floats(value: Value<'static>) -> Option<Vec<f32>> {
    match value {
        Value::Floats(v) => Some(v.into_owned()),
        _ => None,
    }
}

fn float2s(value: Value<'static>) -> Option<Vec<[f32; 2]>> {
    match value {
        Value::Float2s(v) => Some(v.into_owned()),
        _ => None,
    }
}

fn float3s(value: Value<'static>) -> Option<Vec<[f32; 3]>> {
    match value {
        Value::Float3s(v) => Some(v.into_owned()),
        _ => None,
    }
}

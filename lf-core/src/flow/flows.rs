//! All flows of a scene.

use super::{
    kinds::Flow,
    terms::{Sampled, term},
    velocity::Velocity,
};
use crate::{Error, Refusal, field::Field, io};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::{fmt, path::Path};

/// Largest number of integration steps from frame to frame. A flow that needs more has a wrong unit.
pub const MOST_STEPS: f64 = 1e5;

/// One flow, or several whose velocities add up. In a scene: an object, or a list of objects.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Flows {
    /// One flow.
    One(Flow),
    /// Several flows that add up.
    Sum(Vec<Flow>),
}

impl<'de> Deserialize<'de> for Flows {
    // Written by hand: serde's choice between the two variants would hide the error of either.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OneOrMore)
    }
}

/// Reads an object as one flow and a list as several.
struct OneOrMore;

impl<'de> Visitor<'de> for OneOrMore {
    type Value = Flows;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a flow or a list of flows")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Flows, A::Error> {
        Flow::deserialize(MapAccessDeserializer::new(map)).map(Flows::One)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Flows, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(list)).map(Flows::Sum)
    }
}

impl Flows {
    fn all(&self) -> &[Flow] {
        match self {
            Self::One(flow) => std::slice::from_ref(flow),
            Self::Sum(flows) => flows,
        }
    }

    /// Makes the paths of files relative to a folder.
    pub fn join(&mut self, folder: &Path) {
        let flows = match self {
            Self::One(flow) => std::slice::from_mut(flow),
            Self::Sum(flows) => flows,
        };
        for flow in flows {
            if let Flow::Sampled { path } | Flow::Tracks { path } = flow {
                *path = folder.join(&*path);
            }
        }
    }

    /// Files of the sampled fields, in their order.
    pub fn sampled(&self) -> Vec<&Path> {
        self.all().iter().filter_map(Flow::sampled).collect()
    }

    /// File of the tracks; None if the flow is of another kind.
    pub fn tracks(&self) -> Option<&Path> {
        if let [Flow::Tracks { path }] = self.all() { Some(path) } else { None }
    }

    /// Checks the numbers of all flows. Tracks cannot be added to other flows.
    pub fn check(&self) -> Result<(), Refusal> {
        let flows = self.all();
        let fits = flows.len() == 1 || !flows.iter().any(|flow| matches!(flow, Flow::Tracks { .. }));
        Refusal::unless(fits, || "flow has kind 'tracks' beside other flows", "wanted it alone")?;
        flows.iter().try_for_each(Flow::check)
    }

    /// The velocity field in a volume; `pixel_mm` is the side of a pixel at the focal plane, `scene` names the scene in
    /// messages. Refuses a sampled field with gaps, and a flow that needs more than [`MOST_STEPS`].
    pub fn open(&self, bounds_mm: [[f64; 2]; 3], pixel_mm: f64, scene: &str) -> crate::Result<Velocity> {
        let open = |path: &Path| Sampled::new(&Field::open(path)?).map_err(|refusal| refusal.about(io::name(path)));
        let sampled: crate::Result<Vec<Sampled>> = self.sampled().into_iter().map(open).collect();
        let velocity = self.velocity(sampled?, bounds_mm, pixel_mm);
        if velocity.steps() > MOST_STEPS {
            let found = format!("flow needs {:.1e} steps from frame to frame", velocity.steps());
            return Err(Error::new(scene, found, format!("wanted at most {MOST_STEPS:.0e}: a gentler flow")));
        }
        Ok(velocity)
    }

    /// [`Flows::open`] with the fields of the sampled flows in their order.
    pub fn velocity(&self, sampled: Vec<Sampled>, bounds_mm: [[f64; 2]; 3], pixel_mm: f64) -> Velocity {
        let mut sampled = sampled.into_iter();
        let terms = self.all().iter().map(|flow| term(flow, &mut sampled, bounds_mm, pixel_mm)).collect();
        let is_uniform = self.all().iter().all(|flow| matches!(flow, Flow::Uniform { .. } | Flow::Tracks { .. }));
        Velocity::new(terms, is_uniform, bounds_mm)
    }
}

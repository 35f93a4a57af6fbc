//! The state of an unfinished training: safetensors with burn's records of the network and of the optimiser.

use super::{TrainingError, failed};
use burn::module::Module;
use burn::optim::{ModuleOptimizer, OptimizerRecord};
use burn::store::ModuleRecord;
use burn::tensor::Bytes;
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};
use std::collections::HashMap;
use std::path::Path;

pub(super) struct Checkpoint {
    /// The number of steps done.
    pub step: usize,
    network: Vec<u8>,
    optimiser: Vec<u8>,
}

const STEP: &str = "step";
const OF: &str = "of";

impl Checkpoint {
    pub fn new(
        path: &Path,
        model: &impl Module,
        adam: &ModuleOptimizer,
        step: usize,
    ) -> Result<Self, TrainingError> {
        let bytes = |bytes: Result<Bytes, _>| {
            bytes
                .map(|b| b.to_vec())
                .map_err(|error: burn::store::RecordError| failed(path, &error))
        };
        Ok(Self {
            step,
            network: bytes(model.clone().into_record().into_bytes())?,
            optimiser: bytes(adam.to_record().into_bytes())?,
        })
    }

    /// Written beside `path`, then renamed.
    pub fn write(&self, path: &Path, of: &str) -> Result<(), TrainingError> {
        let view = |bytes| {
            TensorView::new(Dtype::U8, vec![<[u8]>::len(bytes)], bytes).map_err(|error| failed(path, &error))
        };
        let tensors = [
            ("network", view(&self.network)?),
            ("optimiser", view(&self.optimiser)?),
        ];
        let about =
            [(STEP, self.step.to_string()), (OF, of.to_owned())].map(|(key, value)| (key.to_owned(), value));
        let bytes = serialize(tensors, Some(HashMap::from(about))).map_err(|error| failed(path, &error))?;
        crate::files::write_whole(path, &bytes).map_err(|error| failed(path, &error))
    }

    pub fn read(path: &Path, of: &str) -> Result<Self, TrainingError> {
        let whole = std::fs::read(path).map_err(|error| failed(path, &error))?;
        let broken = |what: &dyn std::fmt::Display| {
            failed(path, &format!("not a whole checkpoint ({what}): delete it"))
        };
        let (_, header) = SafeTensors::read_metadata(&whole).map_err(|error| broken(&error))?;
        let about = header.metadata().as_ref();
        let about = |key: &str| {
            about
                .and_then(|about| about.get(key))
                .ok_or_else(|| broken(&format!("no `{key}`")))
        };
        if about(OF)? != of {
            let message = format!(
                "a checkpoint of another training ({}), this one is {of}: delete it or repeat that",
                about(OF)?
            );
            return Err(failed(path, &message));
        }
        let step = about(STEP)?.parse().map_err(|error| broken(&error))?;
        let tensors = SafeTensors::deserialize(&whole).map_err(|error| broken(&error))?;
        let bytes = |name| {
            tensors
                .tensor(name)
                .map(|view| view.data().to_vec())
                .map_err(|error| broken(&error))
        };
        Ok(Self {
            step,
            network: bytes("network")?,
            optimiser: bytes("optimiser")?,
        })
    }

    pub fn load<M: Module>(
        &self,
        path: &Path,
        model: M,
        adam: ModuleOptimizer,
    ) -> Result<(M, ModuleOptimizer), TrainingError> {
        let bytes = |bytes: &Vec<u8>| Bytes::from_bytes_vec(bytes.clone());
        let network = ModuleRecord::from_bytes(bytes(&self.network)).map_err(|error| failed(path, &error))?;
        let optimiser =
            OptimizerRecord::from_bytes(bytes(&self.optimiser)).map_err(|error| failed(path, &error))?;
        Ok((model.load_record(network), adam.load_record(optimiser)))
    }
}

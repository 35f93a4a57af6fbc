//! Matches of pairs put together into tracks: one point of the object through the frames.

/// Where a track is seen: frame and feature.
pub type Seen = [u32; 2];

/// Tracks from feature matches of frame pairs, each with at most one feature a frame. `counts` are the features per frame.
pub fn tracks<'a>(
    counts: &[usize],
    pairs: impl Iterator<Item = ([usize; 2], &'a [[u32; 2]])>,
) -> Vec<Vec<Seen>> {
    let starts: Vec<usize> = counts
        .iter()
        .scan(0, |sum, &count| {
            let start = *sum;
            *sum += count;
            Some(start)
        })
        .collect();
    let total = counts.iter().sum();
    let mut parent: Vec<usize> = (0..total).collect();
    let mut frames: Vec<Vec<u32>> = vec![Vec::new(); total];
    for (frame, &start) in starts.iter().enumerate() {
        frames[start..start + counts[frame]].fill(vec![frame as u32]);
    }
    for ([a, b], matches) in pairs {
        for &[i, j] in matches {
            let (i, j) = (
                root(&mut parent, starts[a] + i as usize),
                root(&mut parent, starts[b] + j as usize),
            );
            // Two features of one frame are not one point: the later match is the wrong one.
            if i == j || frames[i].iter().any(|frame| frames[j].contains(frame)) {
                continue;
            }
            let (kept, gone) = (i.min(j), i.max(j));
            parent[gone] = kept;
            let more = std::mem::take(&mut frames[gone]);
            frames[kept].extend(more);
        }
    }
    let mut tracks: Vec<Vec<Seen>> = vec![Vec::new(); total];
    for (frame, (&start, &count)) in starts.iter().zip(counts).enumerate() {
        for feature in 0..count {
            tracks[root(&mut parent, start + feature)].push([frame as u32, feature as u32]);
        }
    }
    tracks.retain(|track| track.len() > 1);
    tracks
}

fn root(parent: &mut [usize], mut node: usize) -> usize {
    while parent[node] != node {
        parent[node] = parent[parent[node]];
        node = parent[node];
    }
    node
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_become_tracks_with_one_feature_a_frame() {
        let pairs: [([usize; 2], &[[u32; 2]]); 3] = [
            ([0, 1], &[[0, 1], [1, 0]]),
            ([1, 2], &[[1, 2]]),
            // Feature 1 of frame 0 is in the first track already through [0, 0]'s frame: refused.
            ([0, 2], &[[1, 2], [2, 0]]),
        ];
        let found = tracks(&[3, 2, 3], pairs.into_iter());
        assert_eq!(
            found,
            [
                vec![[0, 0], [1, 1], [2, 2]],
                vec![[0, 1], [1, 0]],
                vec![[0, 2], [2, 0]]
            ]
        );
    }
}

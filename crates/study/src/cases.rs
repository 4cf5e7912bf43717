//! The hard cases that are built in: every file of `models/hard/`.

/// Name and text of each file, in the order of names.
pub const CASES: &[(&str, &str)] = &[
    ("a01-logistic-apex.dls", include_str!("../../../models/hard/a01-logistic-apex.dls")),
    ("a01c-logistic-closed.dls", include_str!("../../../models/hard/a01c-logistic-closed.dls")),
    ("a02-born-on-boundary.dls", include_str!("../../../models/hard/a02-born-on-boundary.dls")),
    ("a03-event-on-frame.dls", include_str!("../../../models/hard/a03-event-on-frame.dls")),
    ("a04-dragon-on-frames.dls", include_str!("../../../models/hard/a04-dragon-on-frames.dls")),
    ("a05-frame-at-1e6.dls", include_str!("../../../models/hard/a05-frame-at-1e6.dls")),
    ("b01-graze.dls", include_str!("../../../models/hard/b01-graze.dls")),
    ("b02-graze-pair.dls", include_str!("../../../models/hard/b02-graze-pair.dls")),
    ("b03-near-miss.dls", include_str!("../../../models/hard/b03-near-miss.dls")),
    (
        "b05-growth-ends-on-threshold.dls",
        include_str!("../../../models/hard/b05-growth-ends-on-threshold.dls"),
    ),
    ("c01-pair-in-one-step.dls", include_str!("../../../models/hard/c01-pair-in-one-step.dls")),
    ("c02-three-roots.dls", include_str!("../../../models/hard/c02-three-roots.dls")),
    ("c03-short-pulse.dls", include_str!("../../../models/hard/c03-short-pulse.dls")),
    (
        "d01-divisions-at-one-instant.dls",
        include_str!("../../../models/hard/d01-divisions-at-one-instant.dls"),
    ),
    ("d02-simultaneous-context.dls", include_str!("../../../models/hard/d02-simultaneous-context.dls")),
    ("d04-decimal-tie.dls", include_str!("../../../models/hard/d04-decimal-tie.dls")),
    ("d06-cascade-of-1000.dls", include_str!("../../../models/hard/d06-cascade-of-1000.dls")),
    ("d07-cascade-without-end.dls", include_str!("../../../models/hard/d07-cascade-without-end.dls")),
    ("d08-hormone-catches-apex.dls", include_str!("../../../models/hard/d08-hormone-catches-apex.dls")),
    ("e01-limit-is-threshold.dls", include_str!("../../../models/hard/e01-limit-is-threshold.dls")),
    ("e02-barely-reached.dls", include_str!("../../../models/hard/e02-barely-reached.dls")),
    ("e03-very-slow.dls", include_str!("../../../models/hard/e03-very-slow.dls")),
    ("f01-halving-lifetimes.dls", include_str!("../../../models/hard/f01-halving-lifetimes.dls")),
    ("f02-bouncing-ball.dls", include_str!("../../../models/hard/f02-bouncing-ball.dls")),
    ("f03-sliding.dls", include_str!("../../../models/hard/f03-sliding.dls")),
    ("f05-ten-thousand-bounces.dls", include_str!("../../../models/hard/f05-ten-thousand-bounces.dls")),
    ("g01-300-decades.dls", include_str!("../../../models/hard/g01-300-decades.dls")),
    ("g02-logistic-from-1e-300.dls", include_str!("../../../models/hard/g02-logistic-from-1e-300.dls")),
    ("g03-overflow.dls", include_str!("../../../models/hard/g03-overflow.dls")),
    ("g05-cancellation.dls", include_str!("../../../models/hard/g05-cancellation.dls")),
    ("g07-undefined-beyond.dls", include_str!("../../../models/hard/g07-undefined-beyond.dls")),
    ("g09-far-from-zero.dls", include_str!("../../../models/hard/g09-far-from-zero.dls")),
    ("h01-million-generations.dls", include_str!("../../../models/hard/h01-million-generations.dls")),
    ("h02-ten-thousand-crossings.dls", include_str!("../../../models/hard/h02-ten-thousand-crossings.dls")),
    ("h03-million-modules.dls", include_str!("../../../models/hard/h03-million-modules.dls")),
    ("h05-length-is-kept.dls", include_str!("../../../models/hard/h05-length-is-kept.dls")),
    ("i01-chain-stiff.dls", include_str!("../../../models/hard/i01-chain-stiff.dls")),
    ("i02-chain-not-stiff.dls", include_str!("../../../models/hard/i02-chain-not-stiff.dls")),
    ("i03-first-heterocyst.dls", include_str!("../../../models/hard/i03-first-heterocyst.dls")),
    ("i03b-neighbours-in-order.dls", include_str!("../../../models/hard/i03b-neighbours-in-order.dls")),
    ("i04-prothero-robinson.dls", include_str!("../../../models/hard/i04-prothero-robinson.dls")),
    ("i06-robertson.dls", include_str!("../../../models/hard/i06-robertson.dls")),
    (
        "i07-cell-between-empty-cells.dls",
        include_str!("../../../models/hard/i07-cell-between-empty-cells.dls"),
    ),
    ("k01-event-at-the-end.dls", include_str!("../../../models/hard/k01-event-at-the-end.dls")),
    ("k03-event-in-the-first-step.dls", include_str!("../../../models/hard/k03-event-in-the-first-step.dls")),
    ("k04-oscillating.dls", include_str!("../../../models/hard/k04-oscillating.dls")),
    ("l01-anabaena.dls", include_str!("../../../models/hard/l01-anabaena.dls")),
    ("l02-anabaena.dls", include_str!("../../../models/hard/l02-anabaena.dls")),
    ("n01-organs-that-end-growth.dls", include_str!("../../../models/hard/n01-organs-that-end-growth.dls")),
    ("n02-two-events-1e-12-apart.dls", include_str!("../../../models/hard/n02-two-events-1e-12-apart.dls")),
    ("n03-event-on-a-neighbour.dls", include_str!("../../../models/hard/n03-event-on-a-neighbour.dls")),
    ("n04-resonant-chain.dls", include_str!("../../../models/hard/n04-resonant-chain.dls")),
    (
        "n05-approach-to-within-2p-40.dls",
        include_str!("../../../models/hard/n05-approach-to-within-2p-40.dls"),
    ),
    (
        "n06-crossings-that-do-not-count.dls",
        include_str!("../../../models/hard/n06-crossings-that-do-not-count.dls"),
    ),
    ("n07-staircase.dls", include_str!("../../../models/hard/n07-staircase.dls")),
    ("n08-min-max-abs.dls", include_str!("../../../models/hard/n08-min-max-abs.dls")),
    ("n09-tangent-to-a-million.dls", include_str!("../../../models/hard/n09-tangent-to-a-million.dls")),
    ("n10-pole.dls", include_str!("../../../models/hard/n10-pole.dls")),
    ("n11-double-root-of-the-rate.dls", include_str!("../../../models/hard/n11-double-root-of-the-rate.dls")),
    ("n12-hat-of-light.dls", include_str!("../../../models/hard/n12-hat-of-light.dls")),
    ("n13-released-resource.dls", include_str!("../../../models/hard/n13-released-resource.dls")),
    ("n14-births-in-a-chain.dls", include_str!("../../../models/hard/n14-births-in-a-chain.dls")),
    (
        "n15-short-lives-far-from-zero.dls",
        include_str!("../../../models/hard/n15-short-lives-far-from-zero.dls"),
    ),
    ("n16-square-root-decay.dls", include_str!("../../../models/hard/n16-square-root-decay.dls")),
    ("n17-limit-in-a-neighbour.dls", include_str!("../../../models/hard/n17-limit-in-a-neighbour.dls")),
    ("n18-gompertz.dls", include_str!("../../../models/hard/n18-gompertz.dls")),
    ("n19-sine-touches-one.dls", include_str!("../../../models/hard/n19-sine-touches-one.dls")),
    ("n20-arrival-and-rest.dls", include_str!("../../../models/hard/n20-arrival-and-rest.dls")),
    ("n21-outside-the-domain.dls", include_str!("../../../models/hard/n21-outside-the-domain.dls")),
    ("n22-gaussian-of-light.dls", include_str!("../../../models/hard/n22-gaussian-of-light.dls")),
    (
        "n23-stiff-filament-with-events.dls",
        include_str!("../../../models/hard/n23-stiff-filament-with-events.dls"),
    ),
    ("n24-stiff-tree.dls", include_str!("../../../models/hard/n24-stiff-tree.dls")),
    ("n25-robertson-late.dls", include_str!("../../../models/hard/n25-robertson-late.dls")),
    ("n26-van-der-pol.dls", include_str!("../../../models/hard/n26-van-der-pol.dls")),
    ("n27-jumped-over.dls", include_str!("../../../models/hard/n27-jumped-over.dls")),
    ("n28-exchange-of-neighbours.dls", include_str!("../../../models/hard/n28-exchange-of-neighbours.dls")),
    (
        "n29-lives-over-twelve-decades.dls",
        include_str!("../../../models/hard/n29-lives-over-twelve-decades.dls"),
    ),
    (
        "n30-decimal-ties-for-generations.dls",
        include_str!("../../../models/hard/n30-decimal-ties-for-generations.dls"),
    ),
    ("n31-transport-one-way.dls", include_str!("../../../models/hard/n31-transport-one-way.dls")),
    ("n32-what-is-left-of-much.dls", include_str!("../../../models/hard/n32-what-is-left-of-much.dls")),
    ("n33-stiff-chain-and-source.dls", include_str!("../../../models/hard/n33-stiff-chain-and-source.dls")),
    ("n40-short-of-a-limit.dls", include_str!("../../../models/hard/n40-short-of-a-limit.dls")),
    ("n41-late-light.dls", include_str!("../../../models/hard/n41-late-light.dls")),
    ("n42-neighbours-equalise.dls", include_str!("../../../models/hard/n42-neighbours-equalise.dls")),
    ("n43-touch-in-doubt.dls", include_str!("../../../models/hard/n43-touch-in-doubt.dls")),
    (
        "n44-twins-with-other-neighbours.dls",
        include_str!("../../../models/hard/n44-twins-with-other-neighbours.dls"),
    ),
    ("n45-flash-along-a-parameter.dls", include_str!("../../../models/hard/n45-flash-along-a-parameter.dls")),
    ("n46-flash-in-a-neighbour.dls", include_str!("../../../models/hard/n46-flash-in-a-neighbour.dls")),
    ("n47-kinks-along-a-chain.dls", include_str!("../../../models/hard/n47-kinks-along-a-chain.dls")),
    ("n48-sum-with-a-condition.dls", include_str!("../../../models/hard/n48-sum-with-a-condition.dls")),
    (
        "n49-root-ends-for-a-neighbour.dls",
        include_str!("../../../models/hard/n49-root-ends-for-a-neighbour.dls"),
    ),
    ("n50-rest-on-a-kink.dls", include_str!("../../../models/hard/n50-rest-on-a-kink.dls")),
    (
        "n51-rate-leaves-zero-like-a-root.dls",
        include_str!("../../../models/hard/n51-rate-leaves-zero-like-a-root.dls"),
    ),
    (
        "n52-equations-that-come-with-a-neighbour.dls",
        include_str!("../../../models/hard/n52-equations-that-come-with-a-neighbour.dls"),
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Case;

    #[test]
    fn the_list_is_the_directory() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/hard");
        let entries = std::fs::read_dir(folder).expect("the folder");
        let mut files: Vec<String> = entries
            .map(|entry| entry.expect("readable").file_name().into_string().expect("UTF-8"))
            .filter(|name| name.ends_with(".dls"))
            .collect();
        files.sort();
        let listed: Vec<&str> = CASES.iter().map(|(name, _)| *name).collect();
        assert_eq!(listed, files);
    }

    #[test]
    fn every_case_is_read_and_has_its_own_name() {
        let mut ids: Vec<String> = Vec::new();
        for (name, text) in CASES {
            let case = Case::parse(name, text).unwrap_or_else(|e| panic!("{e}"));
            assert!(!case.why.is_empty() && !case.source.is_empty(), "{name}: why, and says who?");
            assert!(!ids.contains(&case.id), "{name}: {} is there already", case.id);
            ids.push(case.id);
        }
    }
}

"""Figures printed by Yueh, Li, Lin & Yau, SIAM J. Imaging Sci. 13(3), 2020, by look-alike mesh.

The paper's own meshes are not public; the keys name meshes of the same kind and face count.
"""

from __future__ import annotations

PETAL, VERTEBRA = "petal_ring_synth_14506", "vertebra_L3_ssm_16420"
ROCKER_ARM, KITTEN = "rocker_arm_25182", "kitten_21584"
MESHES = (PETAL, VERTEBRA, ROCKER_ARM, KITTEN)

# Table 3.1, Reeb graph: lengths of the two loops, seconds.
LOOPS = {
    PETAL: (1.1012, 4.3046, 0.51),
    VERTEBRA: (1.0358, 1.9880, 0.59),
    ROCKER_ARM: (2.0576, 2.3290, 0.87),
    KITTEN: (0.4661, 1.5106, 0.73),
}

# Table 6.1, holomorphic 1-forms: conformal energy, seconds.
CONFORMAL = {
    PETAL: (2.4208e-3, 0.39),
    VERTEBRA: (2.0385e-3, 0.44),
    ROCKER_ARM: (3.6363e-4, 0.70),
    KITTEN: (1.8056e-3, 0.56),
}

# Table 6.2: total area distortion, mean and SD of the ring ratios, flips.
AREA = {
    PETAL: (0.0169, 1.0000, 0.0288, 0),
    VERTEBRA: (0.0201, 0.9999, 0.0367, 0),
    ROCKER_ARM: (0.0119, 1.0001, 0.0200, 0),
    KITTEN: (0.0465, 1.0006, 0.0999, 0),
}

# Table 6.3, 20 steps, by c: total volume distortion, ring mean and SD, flips, seconds.
VOLUME = {
    PETAL: {
        0: (0.2751, 1.0284, 0.3513, 504, 11.67),
        1: (0.2945, 1.0320, 0.3957, 198, 11.45),
        10: (0.3862, 1.0281, 0.5257, 14, 11.38),
    },
    VERTEBRA: {
        0: (0.3227, 1.0180, 0.3710, 49, 19.56),
        1: (0.3401, 1.0192, 0.3943, 7, 19.58),
        10: (0.3879, 1.0228, 0.4895, 0, 19.74),
    },
    ROCKER_ARM: {
        0: (0.0960, 1.0059, 0.1472, 583, 25.46),
        1: (0.1277, 1.0108, 0.2037, 216, 25.46),
        10: (0.2818, 1.0112, 0.3887, 14, 25.40),
    },
    KITTEN: {
        0: (0.1440, 1.0053, 0.2018, 373, 39.71),
        1: (0.1748, 1.0106, 0.2585, 161, 39.85),
        10: (0.2875, 1.0289, 0.4790, 30, 39.94),
    },
}

# Table 6.4, c = 10, by steps: total volume distortion, mean and SD of the ring ratios, flips.
STEPS = {
    PETAL: {
        0: (0.5859, 1.0014, 0.7348, 656),
        1: (0.5664, 1.0046, 0.7152, 209),
        5: (0.5045, 1.0141, 0.6517, 37),
        10: (0.4514, 1.0212, 0.5955, 19),
        20: (0.3862, 1.0281, 0.5257, 14),
    },
    VERTEBRA: {
        0: (0.6092, 1.0107, 0.7508, 9109),
        1: (0.5922, 1.0142, 0.7299, 518),
        5: (0.5136, 1.0203, 0.6385, 3),
        10: (0.4500, 1.0228, 0.5657, 0),
        20: (0.3879, 1.0228, 0.4895, 0),
    },
    ROCKER_ARM: {
        0: (0.5650, 0.9734, 0.7041, 670),
        1: (0.5380, 0.9780, 0.6719, 304),
        5: (0.4505, 0.9912, 0.5712, 41),
        10: (0.3734, 1.0012, 0.4860, 15),
        20: (0.2818, 1.0112, 0.3887, 14),
    },
    KITTEN: {
        0: (0.5392, 1.0612, 0.8085, 5081),
        1: (0.5123, 1.0583, 0.7770, 120),
        5: (0.4288, 1.0482, 0.6746, 24),
        10: (0.3607, 1.0394, 0.5867, 23),
        20: (0.2875, 1.0289, 0.4790, 30),
    },
}

# Table 7.1, the nested shells of 1/5 to 4/5 of the volume: relative errors of their volumes.
SHELLS = {VERTEBRA: (0.0008, 0.0006, 0.0017, 0.0015)}

# Section 7.1: mean and SD of the ring ratios and D_volume of two vertebrae with 38 landmarks.
REGISTRATION = (0.9944, 0.1214, 0.0739)
# What stands in for them, on top of MESHES.
VERTEBRAE = (VERTEBRA, "vertebra_L4_ssm_16420", "vertebra_L3_vhm")

"""The Cornell box's three paints as linear Rec. 709 reflectance.

Spectra: Cornell University Program of Computer Graphics, "Cornell Box Data", "Surface reflectances",
measured every 4 nm from 400 to 700 nm. Each is lit by CIE D65 and seen through the CIE 1931 observer (the fit
of Wyman, Sloan and Shirley 2013, JCGT 2(2), Eq. 4), so that a perfect reflector is exactly white.
"""

import numpy as np

# Thousandths.
WHITE = """343 445 551 624 665 687 708 723 715 710 745 758 739 767 777 765 751 745 748 729 745 757 753 750 746
747 735 732 739 734 725 721 733 725 732 743 744 748 728 716 733 726 713 740 754 764 752 736 734 741
740 732 745 755 751 744 731 733 744 731 712 708 729 730 727 707 703 729 750 760 751 739 724 730 740
737"""
GREEN = """92 96 98 97 98 95 95 97 95 94 97 98 96 101 103 104 107 109 112 115 125 140 160 187 229 285 343 390
435 464 472 476 481 462 447 441 426 406 373 347 337 314 285 277 266 250 230 207 186 171 160 148 141
136 130 126 123 121 122 119 114 115 117 117 118 120 122 128 132 139 144 146 150 152 157 159"""
RED = """40 46 48 53 49 50 53 55 57 56 59 57 61 61 60 62 62 62 61 62 60 59 57 58 58 58 56 55 56 59 57 55 59
59 58 59 61 61 63 63 67 68 72 80 90 99 124 154 192 255 287 349 402 443 487 513 558 584 620 606 609
651 612 610 650 638 627 620 630 628 642 639 657 639 635 642"""
# CIE standard illuminant D65, every 10 nm from 400 to 700 nm (CIE 15:2004).
D65 = """82.7549 91.4860 93.4318 86.6823 104.865 117.008 117.812 114.861 115.923 108.811 109.354 107.802
104.790 107.689 104.405 104.046 100.000 96.3342 95.7880 88.6856 90.0062 89.5991 87.6987 83.2886
83.6992 80.0268 80.2146 82.2778 78.2842 69.7213 71.6091"""
XYZ_TO_REC709 = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


def _lobe(wavelength: np.ndarray, center: float, below: float, above: float) -> np.ndarray:
    scaled = (wavelength - center) * np.where(wavelength < center, below, above)
    return np.exp(-0.5 * scaled**2)


def _observer(nm: np.ndarray) -> np.ndarray:
    x = 0.362 * _lobe(nm, 442.0, 0.0624, 0.0374) + 1.056 * _lobe(nm, 599.8, 0.0264, 0.0323)
    x -= 0.065 * _lobe(nm, 501.1, 0.0490, 0.0382)
    y = 0.821 * _lobe(nm, 568.8, 0.0213, 0.0247) + 0.286 * _lobe(nm, 530.9, 0.0613, 0.0322)
    z = 1.217 * _lobe(nm, 437.0, 0.0845, 0.0278) + 0.681 * _lobe(nm, 459.0, 0.0385, 0.0725)
    return np.stack([x, y, z])


def linear_rgb(spectrum: str) -> tuple[float, float, float]:
    """Linear Rec. 709 reflectance, to four decimals, of a spectrum in thousandths every 4 nm from 400 nm."""
    nm = np.arange(400.0, 701.0, 4.0)
    reflectance = np.array(spectrum.split(), np.float64) / 1000.0
    illuminant = np.interp(nm, np.arange(400.0, 701.0, 10.0), np.array(D65.split(), np.float64))
    weights = XYZ_TO_REC709 @ (_observer(nm) * illuminant)
    red, green, blue = np.round(weights @ reflectance / weights.sum(axis=1), 4)
    return float(red), float(green), float(blue)

/* SPDX-License-Identifier: MIT */
/* Chooses the beam of a pulse, and how far pulses are followed through glass and mirrors. Both are measured on the
 * scene where the configuration leaves them open. */
#ifndef FIRMWARE_SIM_SITE_BEAM_CHOICE_H
#define FIRMWARE_SIM_SITE_BEAM_CHOICE_H

struct sh_err;
struct sh_report;
struct site;

/* After all else of the site. Sets beam, rings and depth of site->plan.methods and the rows of beam and
 * optics, and makes the stations' beams. Warns where no method holds the tolerances. For `plan`
 * (site->measures) the error of forced methods is measured, too. */
int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif

/* SPDX-License-Identifier: MIT */
/* Injected faults that change what is measured. They strike at pulses of the scan that is on. */
#ifndef FIRMWARE_SIM_DEVICE_BEAM_FAULTS_H
#define FIRMWARE_SIM_DEVICE_BEAM_FAULTS_H

#include <stdint.h>

#include "firmware_sim/device/device.h"
#include "firmware_sim/device/scan_state.h"
#include "firmware_sim/fault/board.h"

struct schedule_spec;
struct site;

struct device_beam {
    struct device_scan *scan; /* these three are the device's */
    struct fault_board *board;
    int64_t tick_ns;
    int64_t held_uhz; /* the rotor's speed while its phase is held (phase_lock.c); 0: it runs free */
    double free_ppm;  /* the error of its speed while it runs free */
    uint32_t version; /* of the board's list that `fault` was taken from */
    uint32_t n;
    struct device_beam_fault {
        struct fault_entry entry;
        int strikes;      /* at the scan's next pulse */
        int64_t begin_ns; /* time of its first pulse, since the scan's start */
        double turn;      /* mirror_stuck: where the mirror, or the rotor, stands */
    } fault[FAULT_MAX];
    uint64_t edge;                 /* the next pulse at which one begins or ends; UINT64_MAX: none */
    struct device_disturbance now; /* the disturbance by all that strike together */
};

/* The schedule of a site's head with the settings of the scan, slowed by faults of its mirror. Sets the scan's
 * rates. */
void device_fill_spec(struct device_beam *beam, const struct site *site, struct schedule_spec *spec);
/* Takes over the rates of the scan's settings and faults from a pulse of the scan on. */
void device_set_rates(struct device_beam *beam, uint64_t pulse);
/* Begins and ends the faults that do so at the scan's next pulse, if that fires before until_ns of the scan. The
 * segment has the new rates from there on; each change is noted on the board. Sets the next edge. */
void device_turn_beam(struct device_beam *beam, int64_t until_ns);
/* Returns the loss of optical power by the faults that strike, dB. */
double device_beam_loss_db(const struct device_beam *beam);
/* Ends all faults that strike, when a scan is over or before one begins. t_ns: time since the scan's start. */
void device_end_beam(struct device_beam *beam, int64_t t_ns);

#endif

/* SPDX-License-Identifier: MIT */
/* The settings of a VLP-16 as its clients post them: forms go in, native commands to the device and a status
 * of HTTP come out. Also reads the present settings. VELODYNE.md has all keys.
 *
 * A form is checked as a whole before its first command. Then its commands are carried out in order; the first command
 * that the head refuses ends the form. */
#ifndef DRIVERS_PROTOCOL_VELODYNE_SETTINGS_H
#define DRIVERS_PROTOCOL_VELODYNE_SETTINGS_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/protocol/protocol.h"

enum { VELODYNE_TEXT = 600 }; /* bytes for an error's line */

/* Whether a path takes forms. */
int velodyne_takes_forms(const char *path);
/* Carries out a form of at most HTTP_MAX_BODY bytes. Returns 200; or 400, 409 or 503 with a line of text (cap
 * VELODYNE_TEXT). */
int velodyne_post(const struct protocol_spec *spec, const char *path, const char *form, size_t len, char *text);

struct velodyne_state {
    int motor_on, laser_on; /* it turns; it measures */
    uint32_t rpm;
    const char *returns;             /* "Strongest", "Last", "Dual"; "" if the head selects echoes otherwise */
    int phase_lock;                  /* it is asked for */
    int is_locked;                   /* at the last pulse per second the rotor was where the lock wants it */
    uint32_t offset_cdeg, edge_cdeg; /* azimuth at pulses, 0.01 degree: as asked for; at the last one, or 0 */
};
/* Asks the head for its present state. */
void velodyne_read_state(const struct protocol_spec *spec, struct velodyne_state *out);

/* The address and the port that data are sent to, and the port of position packets; the device's own ones where no
 * link has them. */
const char *velodyne_host_address(const struct protocol_spec *spec);
int velodyne_host_port(const struct protocol_spec *spec);
int velodyne_position_port(const struct protocol_spec *spec);

#endif

/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "drivers/protocol/scip_session.h"

/* DB: malfunctions that the sensor plays, to test its clients. SCIP.md lists the modes 02 to 05, and 10, their end. */
enum { PHASE_SCANS = 10, LONG_STREAM = 20 };

static const char *order(struct scip *s, int32_t mode)
{
    if ((s->features & SCIP_SIMULATION) == 0 || mode == 1) return "04";
    if (mode != 10 && (mode < 2 || mode > 5)) return "01";
    if (mode == 10 && s->simulation.mode == 0) return "03";
    if (mode == s->simulation.mode) return "02";
    if (mode != 10 && s->simulation.broken) return "05";
    return "00";
}

const char *scip_simulate(struct scip *s)
{
    const int32_t mode = scip_number(s->line + 2, 2);
    const char *status = order(s, mode);
    if (strcmp(status, "00") != 0) return status;
    s->simulation = (struct scip_simulation){.mode = mode == 10 ? 0 : mode, .broken = mode == 2};
    if (mode == 2 && s->single.active) {
        s->single.active = 0;
        scip_answer(s, s->single.echo, s->single.echo_len, "50");
    }
    if (mode == 2 && s->stream.active) scip_answer(s, s->stream.echo, s->stream.echo_len, "50");
    if (mode == 2) scip_laser_off(s);
    return status;
}

const char *scip_simulated(struct scip *s)
{
    struct scip_simulation *play = &s->simulation;
    if (play->mode < 3 || (s->stream.count != 0 && s->stream.count <= LONG_STREAM)) return NULL;
    if (s->stream.sent < PHASE_SCANS) return NULL;
    if (play->mode != 5 && play->n_waiting < PHASE_SCANS) return play->n_waiting++ == 0 ? "21" : "";
    if (play->mode == 3) {
        play->mode = 0;
        return "98";
    }
    play->broken = 1;
    return "50";
}

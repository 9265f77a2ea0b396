/* SPDX-License-Identifier: MIT */
/* The waveforms of a .las are repaired with the file (las_repair.c). The packets are inside the file, or in a file of
 * their own: X.wdp.part of a recording that was not completed, else X.wdp. Whole packets are kept. A point whose packet
 * did not reach the disk keeps its place, and says that it has no waveform. Nothing is copied, since a full disk has no
 * room: packets that were not yet inside stay in X.wdp. */
#ifndef DRIVERS_RECORD_LAS_WAVES_REPAIR_H
#define DRIVERS_RECORD_LAS_WAVES_REPAIR_H

#include "drivers/record/repair.h"

struct las_packets {
    struct repair file;  /* of the packets: a .wdp, or the .las itself */
    char *path, *target; /* of a .wdp, and the name that it gets; NULL: it keeps its name */
    uint64_t begin;      /* of the record of packets in its file */
    uint64_t len;        /* bytes of it that are there */
    uint64_t zeros_at;   /* where the zeros of a power cut begin in it; len: there are none */
    uint64_t own_len;    /* bytes that follow its head, as it says itself; 0 while it is being written */
    int is_left;         /* its recorder did not complete it */
    uint64_t last;       /* where the last packet ends that is there and that a point refers to */
    uint64_t end;        /* where its packets end: there, or where its own length ends in a file that was completed */
    size_t wave_at;      /* in a point's record */
    uint64_t n_without;  /* points whose packets are not there */
};

/* Finds the packets of a file with this header. SH_EINPUT: they are not there; SH_ESTATE: the name that they get is
 * taken; SH_EFORMAT: the header can't be right about their place. */
int las_packets_find(struct las_packets *packets, const struct repair *repair, const uint8_t *header,
                     struct sh_err *err);
/* Takes each point's record that is kept. */
void las_packets_take(struct las_packets *packets, const uint8_t *record);
/* Makes points and packets whole, and says in the header where the packets are. Returns 1 where something was
 * changed, 0 where nothing had to be, or a negative error. */
int las_packets_repair(struct las_packets *packets, struct repair *repair, const struct repair_rows *points,
                       uint8_t *header, struct sh_err *err);
/* Gives the .wdp its name, if it gets one; without even the head of its record, that .wdp is removed instead. The .las
 * is synced before: its header then says that X.wdp is its own. */
int las_packets_settle(struct las_packets *packets, const struct repair *repair, struct sh_err *err);
void las_packets_free(struct las_packets *packets);

#endif

/* SPDX-License-Identifier: MIT */
/* The head's points, sorted into cells, so that those near a point are found fast. Points at the same place are one
 * entry. Entries that agree with the same point of a client are one group (match.c says why). */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_MATCH_INDEX_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_MATCH_INDEX_H

#include <stddef.h>
#include <stdint.h>

struct match_entry {
    double p[3];
    int64_t cell[3];
    uint32_t sent; /* how often it was sent, over all sessions; of a group, at its root */
    uint32_t got;  /* how often the client has it; of a group, at its root */
    size_t parent; /* of its group; itself: it is the root */
};

struct match_index {
    struct match_entry *entry; /* sorted by cell and place */
    size_t n;
    double within_m;          /* more than 0 */
    double least[3], most[3]; /* coordinates of entries */
};

/* Sorts the n entries, of which p and sent are filled, and joins those of one place. */
void match_index_make(struct match_index *index);
/* Calls `hit` for each entry whose three coordinates agree with p. Returns how many there are. hit may be NULL. */
size_t match_index_near(const struct match_index *index, const double p[3], void (*hit)(void *ctx, size_t entry),
                        void *ctx);
/* The root of an entry's group. */
size_t match_index_root(struct match_index *index, size_t i);
/* Makes one group of the groups of entries a and b. */
void match_index_join(struct match_index *index, size_t a, size_t b);

#endif

/* SPDX-License-Identifier: MIT */
/* The memory link: one client, in the thread that owns the link. So nothing is copied, locked or waited for. A client
 * that needs bytes lets the link's owner work, and then reads the bytes where the owner wrote them.
 *
 * In: the owner's writes, of any length; the bytes that the client sends, at most MEMORY_ROOM between two turns. A turn
 * is a call of memory_turn, in which the owner works. The owner leaves its bytes unchanged. It repeats a write that
 * took nothing, with the same bytes, until they are taken. */
#ifndef DRIVERS_LINK_MEMORY_H
#define DRIVERS_LINK_MEMORY_H

#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum { MEMORY_ROOM = 4096, MEMORY_PIECES = 16 /* between two turns */ };

/* Both ends share this struct, which begins as zeros and outlives the link. */
struct link_memory {
    /* The link's owner sets this function, which works until there is something for the client, or for at most
     * timeout_ms (-1: for ever). NULL: the owner has not begun, or has ended. */
    void (*turn)(void *owner, int timeout_ms);
    void *owner;
    struct {
        const uint8_t *bytes;
        size_t len;
    } piece[MEMORY_PIECES]; /* written; those from n_taken on are not taken yet */
    uint32_t n_pieces, n_taken;
    uint8_t sent[MEMORY_ROOM]; /* by the client */
    size_t sent_len;
    int over; /* the owner writes nothing more */
    int left; /* the client is gone */
};

/* The client's end. Returns how many bytes the owner wrote at *bytes, where they stay until the next turn; 0: none
 * now. */
size_t memory_take(struct link_memory *memory, const uint8_t **bytes);
/* Sends bytes to the owner. Returns how many were taken; 0: there is no room before the next turn. */
size_t memory_send(struct link_memory *memory, const void *bytes, size_t len);
/* Lets the owner work. */
void memory_turn(struct link_memory *memory, int timeout_ms);
/* The client goes, and its session ends at once. Bytes that it had not taken are lost. A second call does nothing. */
void memory_leave(struct link_memory *memory);

#endif

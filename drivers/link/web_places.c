/* SPDX-License-Identifier: MIT */
#include "drivers/link/web_places.h"

#include <netinet/in.h>
#include <string.h>

void web_address(const struct sockaddr_storage *from, unsigned char address[8])
{
    memset(address, 0, 8);
    if (from->ss_family == AF_INET) {
        memcpy(address, &((const struct sockaddr_in *)from)->sin_addr, 4);
    } else if (from->ss_family == AF_INET6) {
        const struct in6_addr *ip = &((const struct sockaddr_in6 *)from)->sin6_addr;
        if (IN6_IS_ADDR_V4MAPPED(ip))
            memcpy(address, ip->s6_addr + 12, 4);
        else
            memcpy(address, ip->s6_addr, 8);
    }
}

static struct web_place *at(struct web_places places, int i)
{
    return (struct web_place *)(void *)((char *)places.first + (size_t)i * places.stride);
}

static int count_of(struct web_places places, const unsigned char address[8])
{
    int n = 0;
    for (int i = 0; i < WEB_PLACES; i++)
        n += at(places, i)->phase != WEB_NOBODY && memcmp(at(places, i)->address, address, 8) == 0;
    return n;
}

/* Rank of a client in making room: the lowest goes first; 0: it stays. */
static int rank_of(const struct web_place *place, int64_t now_us)
{
    switch (place->phase) {
    case WEB_LINGERING:
    case WEB_PARTING:
        return 1;
    case WEB_ASKING:
        return 2;
    case WEB_ANSWERING:
        return now_us - place->since_us >= 1000 * WEB_GOODBYE_MS ? 3 : 0;
    default:
        return 0;
    }
}

/* Returns the client of `address` that is to go first, or -1: none may go. With NULL it is a client of the address that
 * holds the most places; addresses without a client that may go are left out. */
static int find_silent(struct web_places places, const unsigned char *address, int64_t now_us)
{
    int found = -1, found_n = 0, found_rank = 0;
    for (int i = 0; i < WEB_PLACES; i++) {
        const struct web_place *place = at(places, i);
        const int rank = rank_of(place, now_us), n = count_of(places, place->address);
        if (rank == 0 || (address != NULL && memcmp(place->address, address, 8) != 0)) continue;
        const int sooner = found < 0 || n > found_n ||
                           (n == found_n && (rank < found_rank ||
                                             (rank == found_rank && place->since_us < at(places, found)->since_us)));
        if (!sooner) continue;
        found = i;
        found_n = n;
        found_rank = rank;
    }
    return found;
}

int web_places_take(struct web_places places, const unsigned char address[8], int64_t now_us)
{
    if (count_of(places, address) >= WEB_PLACES_OF_ONE) return find_silent(places, address, now_us);
    for (int i = 0; i < WEB_PLACES; i++)
        if (at(places, i)->phase == WEB_NOBODY) return i;
    return find_silent(places, NULL, now_us);
}

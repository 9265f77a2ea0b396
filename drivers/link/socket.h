/* Settings that every connected TCP socket of the head gets, whoever accepted it. */
#ifndef DRIVERS_LINK_SOCKET_H
#define DRIVERS_LINK_SOCKET_H

/* Small packets leave at once; a peer that has vanished without a word ends the connection after about 25 s, or, with
 * bytes under way to it, when the system gives up repeating them (Linux: some 15 minutes). On sockets that are not TCP
 * this changes nothing. */
void socket_tune(int fd);

/* Beside socket_tune, for a peer that always reads: about 25 s with bytes under way, too. One that only rests for that
 * long would be cut off as well. */
void socket_tune_impatient(int fd);

#endif

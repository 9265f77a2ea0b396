/* Settings that every connected TCP socket of the head gets, whoever accepted it. */
#ifndef DRIVERS_LINK_SOCKET_H
#define DRIVERS_LINK_SOCKET_H

/* Small packets leave at once; a peer that has vanished without a word ends the connection after about 25 s. On sockets
 * that are not TCP this changes nothing. */
void socket_tune(int fd);

#endif

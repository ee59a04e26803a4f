// The page of `framestep console`. Its server adds a token to the address; without a token the page uses Web Serial.

import { start } from "./app.js";
import { WebSocketLink } from "./websocket_link.js";

const token = new URLSearchParams(location.search).get("token");
const scheme = location.protocol === "https:" ? "wss" : "ws";
const address = token && `${scheme}://${location.host}/link?token=${encodeURIComponent(token)}`;
start(
  address && ((how) => WebSocketLink.open(`${address}${how && `&${how}=1`}`)),
  address && (() => WebSocketLink.stop(address)),
);
